//! Pages of `render --report` and `compare --html`. Oracles: the rules of HTML that matter here (every tag is closed,
//! text is escaped, nothing is fetched), the EXR of the same render without a page, and what the statistics say.
//! Deterministic.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use pathspace::film::Film;
use pathspace::film::exr::ExrOptions;
use pathspace::render::Crop;

use crate::common::{signal, wait_for_samples};

/// A name that is markup, and more than one word to a shell.
const HOSTILE: &str = "<img src=x onerror=alert(1)>&\"'.gltf";

fn command(folder: &Path, args: &[&str]) -> Command {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin!("pathspace"));
    command.args(args).current_dir(folder).env_remove("SLURM_CPUS_PER_TASK");
    command
}

fn run(code: i32, folder: &Path, args: &[&str]) -> Output {
    let output = command(folder, args).output().expect("the binary starts");
    assert_eq!(output.status.code(), Some(code), "{args:?}\n{}", err(&output));
    output
}

fn err(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn read(folder: &Path, name: &str) -> String {
    std::fs::read_to_string(folder.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// A folder with the box as a scene of that name.
fn box_named(name: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let scene = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell-box"));
    for (from, to) in [("scene.gltf", name), ("scene.bin", "scene.bin")] {
        std::fs::copy(scene.join(from), folder.path().join(to)).expect("a writable folder");
    }
    folder
}

/// Tags of a page with their attributes, in order; what is in `style` and `script` is left out.
///
/// Panics where a tag is not closed, or closed by another.
fn tags(page: &str) -> Vec<String> {
    let (mut tags, mut open, mut rest) = (Vec::new(), Vec::new(), page);
    while let Some(at) = rest.find('<') {
        let end = at + rest[at..].find('>').expect("a tag that ends");
        let tag = &rest[at + 1..end];
        rest = &rest[end + 1..];
        assert!(!tag.contains('<') && tag.matches('"').count() % 2 == 0, "<{tag}>");
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop().as_deref(), Some(name), "</{name}>");
            continue;
        }
        let name = tag.split([' ', '\n']).next().unwrap_or_default();
        tags.push(tag.to_string());
        if ["style", "script"].contains(&name) {
            rest = &rest[rest.find("</").expect("an end of it")..];
        }
        if !tag.ends_with('/') && !["!doctype", "meta", "img"].contains(&name) {
            open.push(name.to_string());
        }
    }
    assert!(open.is_empty(), "left open: {open:?}");
    tags
}

/// Holds a page to the rules; returns how many pictures it has.
fn check(page: &str) -> usize {
    let tags = tags(page);
    assert!(page.starts_with("<!doctype html>") && page.contains("default-src 'none'"));
    for tag in &tags {
        assert!(!tag.contains("href") && !tag.contains("url("), "<{tag}>");
        let sources = tag.matches(" src=").count();
        assert_eq!(sources, tag.matches(" src=\"data:image/png;base64,iVBOR").count(), "<{tag}>");
        assert!(!tag.contains(" on"), "<{tag}>");
    }
    tags.iter().filter(|tag| tag.starts_with("img ")).count()
}

#[test]
fn a_render_is_told_on_one_page() {
    let folder = box_named(HOSTILE);
    let folder = folder.path();
    let common = ["render", HOSTILE, "--reproducible", "--size", "24x16", "-q", "-s", "64"];
    run(0, folder, &[&common[..], &["-o", "plain.exr"]].concat());
    let more = ["-o", "a.exr", "--report", "a.html", "--stats", "a.json"];
    run(0, folder, &[&common[..], &more].concat());
    let exr = |name: &str| std::fs::read(folder.join(name)).expect("just written");
    assert!(exr("a.exr") == exr("plain.exr"), "a page changed the picture");

    let page = read(folder, "a.html");
    // Picture and noise; curves against seconds and samples.
    assert_eq!((check(&page), page.matches("<svg").count()), (2, 2));
    assert!(page.contains("&lt;img src=x onerror=alert(1)&gt;&amp;&quot;'.gltf") && !page.contains("<img src=x"));
    for part in ["Plan", "Ledger of biases", "Noise", "Statistics", "Command line"] {
        assert!(page.contains(&format!("<h2>{part}</h2>")), "{part}");
    }
    let stats: serde_json::Value = serde_json::from_str(&read(folder, "a.json")).expect("JSON");
    let text = |value: &serde_json::Value| value.as_str().expect("text").replace('<', "&lt;").replace('>', "&gt;");
    for bias in stats["bias"].as_array().expect("a ledger") {
        assert!(page.contains(&text(&bias["what"])), "{bias}");
    }
    assert!(page.contains("max-depth 64") && page.contains(stats["film_hash"].as_str().expect("text")));
    assert!(page.contains(&text(&stats["backend"]["reason"])), "{}", stats["backend"]);
    // The name is one word to a shell.
    assert!(page.contains(r"&amp;&quot;'\''.gltf'"), "quoted");
}

#[test]
fn layers_and_looks_are_on_the_page() {
    let folder = box_named("scene.gltf");
    let folder = folder.path();
    let args = ["render", "scene.gltf", "--png", "a.png", "--report", "a.html", "--size", "400x8", "-s", "1", "-q"];
    let more = ["--aov", "albedo,N,Z,stderr,spp,UV", "--transparent", "--exposure", "2", "--tone-map", "agx"];
    run(0, folder, &[&args[..], &more].concat());
    let page = read(folder, "a.html");
    // One sample knows no noise, so the picture and six layers.
    assert_eq!(check(&page), 7);
    assert!(page.contains("tone curve agx") && page.contains("<code>N</code>: -"));
    assert!(page.contains("width=\"200\" height=\"4\""), "layers are small");
    let bounces =
        ["render", "scene.gltf", "--report", "b.html", "--size", "16x16", "-s", "4", "--aov", "bounces", "-q"];
    run(0, folder, &bounces);
    let page = read(folder, "b.html");
    assert!(check(&page) > 4 && page.contains("<code>bounce_01</code>"));
}

#[test]
fn a_render_that_is_ended_has_its_page() {
    let folder = box_named("scene.gltf");
    let folder = folder.path();
    let args = ["render", "scene.gltf", "-o", "a.exr", "--size", "16x16"];
    run(0, folder, &[&args[..], &["--report", "time.html", "--time", "0.2s", "-q"]].concat());
    let page = read(folder, "time.html");
    check(&page);
    assert!(page.contains("the time was up") && page.contains("--time 0.2s"));

    let more = ["--report", "int.html", "--spp", "100000000", "--progress", "ndjson"];
    let mut child = command(folder, &[&args[..], &more].concat())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .expect("the binary starts");
    wait_for_samples(&mut child);
    signal(&child, "INT");
    assert_eq!(child.wait().expect("it ends").code(), Some(130));
    let page = read(folder, "int.html");
    check(&page);
    assert!(page.contains("<dt>ended by</dt><dd>a signal</dd>"));
}

#[test]
fn pages_that_cannot_be_written_are_refused_in_one_line() {
    let folder = box_named("scene.gltf");
    let folder = folder.path();
    let render = |report| ["render", "scene.gltf", "-o", "a.exr", "--size", "8x8", "-s", "1", "--report", report];
    for (code, report, word) in [(1, "none/a.html", "--make-path"), (2, "a.txt", ".html"), (2, "-", ".html")] {
        let output = run(code, folder, &render(report));
        assert!(err(&output).contains(word) && err(&output).lines().count() == 1, "{}", err(&output));
        assert!(!folder.join("a.exr").exists(), "it is known before the render");
    }
}

/// An EXR of 20 × 5 grey pixels, the first of which is `first`.
fn write_grey(path: &Path, first: f32) {
    let mut film = Film::new((20, 5), Crop { x: 0, y: 0, width: 20, height: 5 });
    for (i, pixel) in film.pixels.iter_mut().enumerate() {
        pixel.add(0, [if i == 0 { first } else { 0.5 }; 3], 1.0, 1.0);
    }
    film.write_exr(path, &ExrOptions::default()).expect("a writable folder");
}

#[test]
fn two_pictures_are_compared_on_one_page() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    let hostile = "<b>&\".exr";
    write_grey(&folder.join("a.exr"), 0.5);
    write_grey(&folder.join(hostile), 0.75);
    run(2, folder, &["compare", hostile, "a.exr", "--html", "a.html", "-o", "a.png"]);
    let page = read(folder, "a.html");
    assert_eq!(check(&page), 4);
    assert!(page.contains("&lt;b&gt;&amp;&quot;.exr against a.exr") && !page.contains("<b>"));
    // By hand: one pixel is off by half of what is there, and the scale ends with it.
    assert!(page.contains("0 to 50.0 % and above") && page.contains("<code>relmse_trimmed</code>"));
    assert!(page.contains("addEventListener") && !page.contains("fetch") && !page.contains("import"));

    // The picture keeps its place; below it twelve rows of scale, as wide as the numbers.
    let drawn = std::fs::read(folder.join("a.png")).expect("just written");
    let side = |at: usize| u32::from_be_bytes(drawn[at..at + 4].try_into().expect("four bytes"));
    assert_eq!((side(16), side(20)), (22, 5 + 12));

    let output = run(4, folder, &["compare", "a.exr", "a.exr", "--html", "none/a.html"]);
    assert!(err(&output).contains("none") && err(&output).lines().count() == 1, "{}", err(&output));
    let output = run(2, folder, &["compare", "a.exr", "a.exr", "--html", "a.txt"]);
    assert!(err(&output).contains(".html"), "{}", err(&output));
}
