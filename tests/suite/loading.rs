use pathspace::Scene;
use std::path::Path;
#[test]
fn six() {
    for n in ["cornell-box", "veach-mis", "glass-caustics", "many-lights", "env-object", "interior"] {
        let t = std::time::Instant::now();
        let s = Scene::load(Path::new("/work/shared/scenes").join(format!("{n}.gltf"))).unwrap();
        eprintln!(
            "{n} {:?} tri {} meshes {} inst {} mat {} tex {} lights {} cams {:?} size {:?} {:?} {:?}",
            t.elapsed(),
            s.triangle_count(),
            s.meshes.len(),
            s.instances.len(),
            s.materials.len(),
            s.textures.len(),
            s.punctual.len(),
            s.cameras,
            s.suggested_size,
            s.dropped,
            s.warnings
        );
    }
    let t = std::time::Instant::now();
    let s = Scene::load("/work/shared/assets/FlightHelmet/FlightHelmet.gltf").unwrap();
    eprintln!(
        "{:?} {} {:?} {:?}",
        t.elapsed(),
        s.triangle_count(),
        s.warnings,
        s.textures.iter().map(|t| (t.width, &t.name)).collect::<Vec<_>>()
    );
    let mut s = s;
    s.load_environment("/work/shared/assets/environments/spiaggia_di_mondello_1k.hdr", 0.0, 1.0).unwrap();
    s.load_environment("/work/shared/scenes/interior.env.exr", 0.0, 1.0).unwrap();
    eprintln!("{:?} {:?}", s.warnings, s.environment.map(|e| (e.width, e.height, e.texels[1024 * 100 + 5])));
}
