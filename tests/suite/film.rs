//! Films as files. Oracles: what was put in, and the definitions of OpenEXR's standard attributes. All deterministic.

use exr::prelude::{
    AnyChannel, AnyChannels, AttributeValue, Encoding, FlatSamples, Image, Layer, LayerAttributes, Text, Vec2,
    WritableImage, read_first_flat_layer_from_file,
};
use pathspace::Error;
use pathspace::film::Film;
use pathspace::film::exr::{ExrOptions, ViewMatrices, read_exr};
use pathspace::film::layer::bounces::LENGTHS;
use pathspace::plan::Aov;
use pathspace::render::Crop;

/// A film of `window` whose pixel (x, y) has mean (x, y, −0.5, 0.75) and halves that differ by 2 in red.
fn gradient(resolution: (u32, u32), window: Crop) -> Film {
    let mut film = Film::new(resolution, window);
    for (i, pixel) in film.pixels.iter_mut().enumerate() {
        let (x, y) = (i as u32 % window.width, i as u32 / window.width);
        for half in 0..2 {
            let red = x as f32 + if half == 0 { 1.0 } else { -1.0 };
            pixel.add(half, [red, y as f32, -0.5], 1.0, 0.75);
        }
    }
    film
}

/// A film of 4 × 3 pixels with two samples from number 32 on and a value in every layer.
fn layered() -> Film {
    let window = Crop { x: 0, y: 0, width: 4, height: 3 };
    let mut film = Film::with_groups((4, 3), window, &Aov::all().collect::<Vec<_>>(), &["default".into()]);
    film.first_sample = 32;
    film.pixels = gradient((4, 3), window).pixels;
    for plane in film.planes_mut() {
        for p in 0..12 {
            let values = plane.pixel_mut(p);
            match values.len() {
                0 => {}
                // Sums of two samples: paths of e edges bring e.
                51 => values.iter_mut().enumerate().for_each(|(i, value)| *value = 2.0 * (i / 3) as f64),
                6 => values.copy_from_slice(&[3.0, 4.0, 5.0, 1.0, 2.0, 3.0]),
                _ => values.copy_from_slice(&[4.0, 6.0, 8.0]),
            }
        }
    }
    film
}

#[test]
fn a_cropped_film_comes_back_from_its_file() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("crop.exr");
    let film = gradient((64, 48), Crop { x: 10, y: 20, width: 7, height: 5 });
    film.write_exr(&path, &ExrOptions::default()).expect("a writable folder");
    let picture = read_exr(&path).expect("just written");
    assert_eq!((picture.display, picture.position), ((64, 48), (10, 20)));
    assert_eq!((picture.width, picture.height), (7, 5));
    for (i, rgb) in picture.rgb.iter().enumerate() {
        assert_eq!(*rgb, [(i % 7) as f32, (i / 7) as f32, -0.5]);
    }
    assert_eq!(picture.alpha, Some(vec![0.75; 35]));
    // Nothing but the file is left in the folder.
    assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 1);
}

#[test]
fn attributes_and_channels_are_those_of_the_contract() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("full.exr");
    let film = layered();
    let view = ViewMatrices { world_to_camera: [2.0; 16], world_to_ndc: [3.0; 16] };
    let options = ExrOptions::default()
        .channels(film.channels(&Aov::all().collect::<Vec<_>>(), 64))
        .render_seconds(1.5)
        .view(view)
        .seed(u64::MAX)
        .backend("brute 0.1.0".to_string())
        .isa("scalar".to_string())
        .plan("camera 日, 3 × é".to_string());
    film.write_exr(&path, &options).expect("a writable folder");
    let image = read_first_flat_layer_from_file(&path).expect("just written");
    let layer = &image.layer_data;

    let names: Vec<String> = layer.channel_data.list.iter().map(|c| c.name.to_string()).collect();
    let bounces = (0..15).map(|k| format!("bounce_{k:02}")).chain(["bounce_tail".into()]);
    let mut expected: Vec<String> =
        ["variance", "stderr", "emission", "direct", "indirect", "albedo", "background", "denoise_albedo"]
            .map(String::from)
            .into_iter()
            .chain(bounces)
            .chain(["diffuse", "glossy", "transmission", "volume", "lightgroup_default"].map(String::from))
            .flat_map(|layer| ["R", "G", "B"].map(|c| format!("{layer}.{c}")))
            .chain(["R", "G", "B", "A", "spp.Y", "Z", "N.X", "N.Y", "N.Z", "Ng.X", "Ng.Y", "Ng.Z"].map(String::from))
            .chain(["P.X", "P.Y", "P.Z", "UV.U", "UV.V", "motion.X", "motion.Y", "coverage.Y"].map(String::from))
            .chain(["X", "Y", "Z"].map(|c| format!("denoise_normal.{c}")))
            .chain(["object", "material", "asset"].into_iter().flat_map(|names| {
                let channel = move |i: usize| format!("crypto_{names}{:02}.{}", i / 4, ["R", "G", "B", "A"][i % 4]);
                (0..12).map(channel)
            }))
            .collect();
    expected.sort();
    assert_eq!(names, expected);
    let channel = |name: &str| -> Vec<f32> {
        let found = layer.channel_data.list.iter().find(|c| c.name.eq(name)).expect("listed above");
        found.sample_data.values_as_f32().collect()
    };
    // Halves of one sample each that differ by 2: (A − B)²/4 = 1.
    assert_eq!((channel("variance.R"), channel("stderr.R")), (vec![1.0; 12], vec![1.0; 12]));
    assert_eq!((channel("variance.B"), channel("spp.Y")), (vec![0.0; 12], vec![2.0; 12]));
    // Paths of e edges have e − 1 bounces; the last accumulator is the tail. A depth limit leaves out what cannot be.
    assert_eq!((channel("bounce_00.G"), channel("bounce_14.R")), (vec![1.0; 12], vec![15.0; 12]));
    assert_eq!(channel("bounce_tail.B"), vec![(LENGTHS - 1) as f32; 12]);
    assert_eq!((channel("N.Z"), channel("Z"), channel("P.Y")), (vec![4.0; 12], vec![4.0; 12], vec![6.0; 12]));
    assert_eq!((channel("denoise_albedo.G"), channel("denoise_normal.Z")), (vec![3.0; 12], vec![4.0; 12]));
    for (max_depth, count) in [(1, 3), (15, 45), (16, 48), (17, 48)] {
        assert_eq!(film.channels(&[Aov::BOUNCES], max_depth).len(), count);
    }

    let attributes = &layer.attributes;
    assert_eq!(attributes.world_to_camera, Some([2.0; 16]));
    assert_eq!(attributes.world_to_normalized_device, Some([3.0; 16]));
    assert!(attributes.software_name.as_ref().is_some_and(|name| name.to_string().starts_with("pathspace ")));
    assert_eq!(attributes.layer_name, None);
    let white = image.attributes.chromaticities.expect("written").white;
    assert_eq!(white, Vec2(0.3127, 0.3290));
    let other = |name: &str| attributes.other.get(&Text::from(name)).cloned();
    let text = |value: &str| Some(AttributeValue::Text(Text::from(value)));
    assert_eq!(other("samplesPerPixel"), Some(AttributeValue::I32(2)));
    assert_eq!(other("renderTimeSeconds"), Some(AttributeValue::F32(1.5)));
    assert_eq!(other("colorInteropID"), text("lin_rec709_scene"));
    assert_eq!(other("pathspace/version"), text(env!("CARGO_PKG_VERSION")));
    assert_eq!(other("pathspace/seed"), text("18446744073709551615"));
    assert_eq!(other("pathspace/sampleRange"), text("32..34"));
    assert_eq!(other("pathspace/backend"), text("brute 0.1.0"));
    assert_eq!(other("pathspace/isa"), text("scalar"));
    let plan = other("pathspace/plan").expect("written");
    let AttributeValue::Text(plan) = plan else { panic!("{plan:?} is not a string") };
    assert_eq!(std::str::from_utf8(plan.as_slice()), Ok("camera 日, 3 × é"));
}

#[test]
fn half_and_grey_files_are_read_and_others_refused() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let write = |name: &str, channels: Vec<(&str, FlatSamples)>| {
        let path = folder.path().join(name);
        let list = channels.into_iter().map(|(name, samples)| AnyChannel::new(name, samples)).collect();
        let layer = Layer::new((2, 1), LayerAttributes::default(), Encoding::FAST_LOSSLESS, AnyChannels::sort(list));
        Image::from_layer(layer).write().to_file(&path).expect("a writable folder");
        path
    };
    let half = |a: f32, b: f32| FlatSamples::F16(vec![half::f16::from_f32(a), half::f16::from_f32(b)]);
    let path = write("half.exr", vec![("R", half(0.1, 1.0)), ("G", half(0.5, 2.0)), ("B", half(0.25, 4.0))]);
    let picture = read_exr(&path).expect("a colour image");
    assert_eq!((picture.rgb, picture.alpha), (vec![[0.099_975_586, 0.5, 0.25], [1.0, 2.0, 4.0]], None));

    let grey = write("grey.exr", vec![("Y", FlatSamples::F32(vec![0.5, 3.0]))]);
    assert_eq!(read_exr(&grey).expect("a grey image").rgb, [[0.5; 3], [3.0; 3]]);

    let depth = write("depth.exr", vec![("Z", half(1.0, 2.0))]);
    let error = read_exr(&depth).expect_err("no colours");
    assert!(matches!(error, Error::Image { .. }) && error.to_string().contains("found Z"), "{error}");
    let broken = folder.path().join("broken.exr");
    std::fs::write(&broken, b"v/1\x01 not an image").expect("a writable folder");
    assert!(read_exr(&broken).expect_err("broken").to_string().contains("broken.exr"));
    assert!(matches!(read_exr(&folder.path().join("none.exr")), Err(Error::Io { .. })));
}

#[test]
fn previews_are_srgb_with_exposure() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("preview.png");
    let mut film = Film::new((2, 1), Crop { x: 0, y: 0, width: 2, height: 1 });
    film.pixels[0].add(0, [0.09, 0.25, -1.0], 1.0, 1.0);
    film.pixels[1].add(0, [1e9, 0.0, 0.5], 1.0, 1.0);
    film.write_png(&path, 1.0).expect("a writable folder");
    let image = image::open(&path).expect("just written").to_rgb8();
    assert_eq!(image.dimensions(), (2, 1));
    // One stop up: 0.18 is code 118, 0.5 is 188.
    assert_eq!(image.into_raw(), [118, 188, 0, 255, 0, 255]);
}

#[test]
fn a_missing_folder_is_named_and_nothing_is_written() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let film = gradient((2, 2), Crop { x: 0, y: 0, width: 2, height: 2 });
    let path = folder.path().join("missing/a.exr");
    let error = film.write_exr(&path, &ExrOptions::default()).expect_err("no such folder");
    assert!(error.to_string().contains("missing/a.exr") && error.exit_code() == 1, "{error}");
    assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 0);
}
