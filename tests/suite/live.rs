//! Renders that are seen while they run: the page's server, `view`, previews, tev. Oracles: the protocol of tev as its
//! sources state it, HTTP by hand, and the picture that is written in the end. Waits have limits; nothing else depends
//! on time.

use std::io::{BufRead, BufReader, ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Far more than any step takes.
const PATIENCE: Duration = Duration::from_secs(60);

pub fn cornell_box() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell-box/scene.gltf")
}

pub fn pathspace(folder: &Path) -> Command {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin!("pathspace"));
    command.current_dir(folder).env_remove("SLURM_CPUS_PER_TASK");
    command
}

/// Little-endian number at `at`.
fn number(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(bytes[at..at + 4].try_into().expect("four bytes"))
}

#[test]
fn tev_is_shown_the_picture() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let address = listener.local_addr().expect("bound").to_string();
    let received = std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().expect("a client");
        let mut bytes = Vec::new();
        stream.read_to_end(&mut bytes).expect("packets");
        bytes
    });
    let scene = cornell_box();
    let output = pathspace(folder.path())
        .args(["render", "-o", "pic.png", "--size", "6x4", "--spp", "4", "--preview", "now.png"])
        .args(["--display-server", &address])
        .arg(&scene)
        .output()
        .expect("the binary starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let same = ["pic.png", "now.png"].map(|name| std::fs::read(folder.path().join(name)).expect("written"));
    assert!(same[0] == same[1], "the last preview is the picture");

    // Length, type; Create is 4: focus, name, width, height, three channels. Update is 6, here of the whole picture.
    let bytes = received.join().expect("received");
    let (mut at, mut kinds, mut last) = (0, Vec::new(), Vec::new());
    while at < bytes.len() {
        let length = number(&bytes, at) as usize;
        kinds.push(bytes[at + 4]);
        last = bytes[at..at + length].to_vec();
        if kinds.len() == 1 {
            assert_eq!(last[5..], *b"\x01pic.png\0\x06\0\0\0\x04\0\0\0\x03\0\0\0R\0G\0B\0");
        }
        at += length;
    }
    assert!(kinds[0] == 4 && kinds.len() >= 2 && kinds[1..].iter().all(|kind| *kind == 6), "{kinds:?}");
    let head = 5 + 1 + 8 + 4 + 6 + 16 + 6 * 8;
    assert_eq!(last.len(), head + 6 * 4 * 3 * 4, "offsets and strides, then 6 × 4 pixels of three floats");
    assert_eq!([24, 28, 32, 36].map(|at| number(&last, at)), [0, 0, 6, 4], "x, y, width, height");

    // Nobody there: said before the scene is loaded.
    let gone = pathspace(folder.path()).args(["render", "a.gltf", "--display-server", &address]).output();
    let gone = String::from_utf8(gone.expect("the binary starts").stderr).expect("text");
    assert!(gone.contains("reach tev"), "{gone}");
}

/// A running `pathspace`, ended when dropped.
pub struct Running {
    child: Child,
    /// Host and port.
    pub address: String,
}

impl Running {
    /// Starts it with `args`, and waits for the address of its page.
    pub fn start(folder: &Path, args: &[&str]) -> Self {
        let mut child = pathspace(folder).args(args).stderr(Stdio::piped()).spawn().expect("the binary starts");
        let stderr = BufReader::new(child.stderr.take().expect("piped"));
        let (said, heard) = std::sync::mpsc::channel();
        // Read to the end, so that the child never waits for room in the pipe.
        std::thread::spawn(move || stderr.lines().map_while(Result::ok).for_each(|line| drop(said.send(line))));
        let line = heard.iter().find(|line| line.contains("see it at")).expect("an address");
        let address = line.split("http://").nth(1).expect("an address").trim_end_matches('/').to_owned();
        Running { child, address }
    }

    fn ask(&self, request: &str) -> (String, Vec<u8>) {
        let mut stream = TcpStream::connect(&self.address).expect("it listens");
        stream.set_read_timeout(Some(PATIENCE)).expect("a socket");
        stream.write_all(request.as_bytes()).expect("it reads");
        let mut bytes = Vec::new();
        // What is turned away may be cut off.
        let _ = stream.read_to_end(&mut bytes);
        let end = bytes.windows(4).position(|part| part == b"\r\n\r\n").map_or(bytes.len(), |end| end + 4);
        (String::from_utf8_lossy(&bytes[..end]).into_owned(), bytes.split_off(end))
    }

    fn get(&self, path: &str) -> Vec<u8> {
        let (head, body) = self.ask(&format!("GET {path} HTTP/1.1\r\nHost: {}\r\n\r\n", self.address));
        assert!(head.starts_with("HTTP/1.1 200"), "{path}: {head}");
        body
    }

    /// The state, once `wanted` holds of it.
    fn state(&self, wanted: impl Fn(&serde_json::Value) -> bool) -> serde_json::Value {
        let started = Instant::now();
        loop {
            let state = serde_json::from_slice(&self.get("/state")).expect("JSON");
            if wanted(&state) {
                return state;
            }
            assert!(started.elapsed() < PATIENCE, "{state}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[test]
fn a_view_is_seen_moved_and_saved() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let scene = cornell_box();
    let scene = scene.to_str().expect("a plain name");
    let options = ["--address", "127.0.0.1:0", "--size", "16x12", "-s", "8", "--camera-orbit", "170,5"];
    let mut view = Running::start(folder.path(), &[&["view", scene][..], &options].concat());
    let page = String::from_utf8(view.get("/")).expect("UTF-8");
    // Nothing from elsewhere.
    assert!(page.contains("<canvas") && !page.contains("https:") && !page.contains("src="));

    let done = view.state(|state| state["done"] == true);
    assert_eq!((done["full"][0].as_u64(), done["spp"].as_u64()), (Some(16), Some(8)));
    let picture = view.get("/picture");
    assert_eq!((number(&picture, 0), number(&picture, 4), picture.len()), (16, 12, 8 + 16 * 12 * 16));
    let story = String::from_utf8(view.get("/replay?x=8&y=6&sample=3")).expect("UTF-8");
    assert!(story.starts_with("pixel 8,6 sample 3: camera ray"), "{story}");
    assert!(view.get("/picture.exr").starts_with(&[0x76, 0x2f, 0x31, 0x01]));
    // The command line renders the same view, in every bit.
    let [line, camera] = ["command", "camera"].map(|key| done[key].as_str().expect("a line"));
    let line = format!("{line}{camera}");
    let words: Vec<&str> = line.split(' ').skip(1).chain(["-q", "-o", "same.exr"]).collect();
    assert!(pathspace(folder.path()).args(&words).status().expect("it starts").success(), "{line}");
    let same = pathspace::film::exr::read_exr(&folder.path().join("same.exr")).expect("just written");
    let shown = |pixel: usize, channel: usize| f32::from_bits(number(&picture, 8 + 16 * pixel + 4 * channel));
    for (i, rgb) in same.rgb.iter().enumerate() {
        assert_eq!(*rgb, [0, 1, 2].map(|channel| shown(i, channel)), "pixel {i}: {line}");
    }

    // Layers: those that need nothing gathered are always there.
    assert_eq!(done["layers"][0], serde_json::json!({"name": "spp", "components": ["Y"]}));
    let spp = view.get("/layer?number=0");
    assert_eq!([0, 4, 8, 12].map(|at| number(&spp, at)), [16, 12, 1, 0], "columns, rows, channels, no colour");
    assert!(spp[16..].chunks_exact(4).all(|value| value == 8f32.to_le_bytes()) && spp.len() == 16 + 4 * 16 * 12);
    assert!(view.ask("GET /layer?number=99 HTTP/1.1\r\nHost: localhost\r\n\r\n").0.contains("503"));

    // Another view: only from the page itself, and only one that a camera can take.
    let mut moved = done["view"].clone();
    moved["azimuth"] = 150.0.into();
    let post = |body: &str, more: &str| {
        let length = body.len();
        let head = format!("POST /view HTTP/1.1\r\nHost: localhost\r\nContent-Length: {length}\r\n{more}\r\n");
        view.ask(&(head + body)).0
    };
    let ours = "X-Pathspace: view\r\n";
    assert!(post(&moved.to_string(), "").starts_with("HTTP/1.1 404"));
    assert!(post(r#"{"azimuth":1}"#, ours).starts_with("HTTP/1.1 400"));
    assert!(post(&moved.to_string(), ours).starts_with("HTTP/1.1 200"));
    let turned = view.state(|state| state["done"] == true && state["view"]["azimuth"] == 150.0);
    assert!(turned["version"].as_u64() > done["version"].as_u64());
    assert!(view.get("/picture") != picture, "another camera sees another picture");

    let camera = turned["camera"].as_str().expect("options");
    assert!(camera.starts_with(" --camera-orbit=150,") && camera.contains(" --look-at="), "{camera}");

    // A layer begins the render again, from where the camera stood at first.
    let mut layered = done["home"].clone();
    layered["layers"] = serde_json::json!(["colour"]);
    assert!(post(&layered.to_string(), ours).starts_with("HTTP/1.1 400"));
    layered["layers"] = serde_json::json!(["albedo"]);
    assert!(post(&layered.to_string(), ours).starts_with("HTTP/1.1 200"));
    let again = view.state(|state| state["done"] == true && state["layers"][3]["name"] == "albedo");
    assert_eq!(again["camera"], " --camera-orbit 170,5 --aov albedo");
    let albedo = view.get("/layer?number=3");
    assert_eq!((number(&albedo, 8), number(&albedo, 12)), (3, 1), "a colour");
    assert!(view.get("/picture") == picture, "the same view");
    assert!(post(&moved.to_string(), ours).starts_with("HTTP/1.1 200"));
    let turned = view.state(|state| state["done"] == true && state["view"]["azimuth"] == 150.0);

    // One that no camera can take after all leaves the last one, and the page goes on.
    let mut nowhere = moved.clone();
    nowhere["target"] = serde_json::json!([1e39, 0.0, 0.0]);
    assert!(post(&nowhere.to_string(), ours).starts_with("HTTP/1.1 200"));
    let version = turned["version"].as_u64();
    view.state(|state| state["done"] == true && state["version"].as_u64() > version && state["view"] == moved);

    // What is no request, comes from another origin, is too long, or never ends: turned away, and the rest works.
    for (request, status) in [
        ("GET / HTTP/1.1\r\nHost: example.org\r\n\r\n".to_owned(), "403"),
        ("GET /state HTTP/1.1\r\nHost: localhost\r\nSec-Fetch-Site: cross-site\r\n\r\n".into(), "403"),
        ("GET /state HTTP/1.1\r\nHost: localhost\r\nSec-Fetch-Site: same-origin\r\n\r\n".into(), "200"),
        ("GET /../etc/passwd HTTP/1.1\r\nHost: localhost\r\n\r\n".into(), "404"),
        ("\0\0\0\0 nonsense\r\n\r\n".into(), "400"),
        (format!("POST /view HTTP/1.1\r\nHost: localhost\r\nContent-Length: {}\r\n\r\n", u64::MAX), "400"),
    ] {
        assert!(view.ask(&request).0.contains(status), "{request}");
    }
    let connect = |_| TcpStream::connect(&view.address).expect("it listens");
    let mut hanging: Vec<_> = (0..100).map(connect).collect();
    view.get("/state");
    // Beyond what is served at a time they are turned away at once; there is room again when others have gone.
    hanging.extend((100..200).map(connect));
    let last = hanging.last_mut().expect("200 of them");
    last.set_read_timeout(Some(Duration::from_secs(6))).expect("a socket");
    let waits = |error: std::io::Error| matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut);
    assert!(last.read(&mut [0]).map_or_else(|error| !waits(error), |n| n == 0), "it was let in");
    drop(hanging);
    let started = Instant::now();
    while !view.ask("GET /state HTTP/1.1\r\nHost: localhost\r\n\r\n").0.starts_with("HTTP/1.1 200") {
        assert!(started.elapsed() < PATIENCE, "nobody is let in any more");
    }

    let kill = Command::new("sh").args(["-c", &format!("kill -INT {}", view.child.id())]).status();
    assert!(kill.is_ok_and(|status| status.success()));
    assert_eq!(view.child.wait().expect("it ends").code(), Some(130));
}

#[test]
fn a_render_is_served_and_others_need_the_secret() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let scene = cornell_box();
    let scene = scene.to_str().expect("a plain name");
    let common = ["render", scene, "-o", "a.exr", "--size", "16x12", "--time", "60s"];
    let render = Running::start(folder.path(), &[&common[..], &["--serve=127.0.0.1:0"]].concat());
    let state = render.state(|state| state["version"].as_u64() > Some(0));
    assert!(state["view"].is_null() && state["done"] == false, "the camera of a render stays: {state}");
    drop(render);

    let refused = pathspace(folder.path()).args(common).arg("--serve=0.0.0.0:0").output().expect("it starts");
    assert_eq!(refused.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&refused.stderr).contains("--serve-anywhere"));
    let open = Running::start(folder.path(), &[&common[..], &["--serve=0.0.0.0:0", "--serve-anywhere"]].concat());
    let (address, token) = open.address.split_once("/?token=").expect("a secret");
    let (port, token) = (address.rsplit(':').next().expect("a port"), token.to_owned());
    let here = Running { child: open_child(folder.path()), address: format!("127.0.0.1:{port}") };
    let ask = |query: &str| here.ask(&format!("GET /state{query} HTTP/1.1\r\nHost: localhost\r\n\r\n")).0;
    assert!(ask("").contains("403") && ask("?token=0").contains("403"));
    assert!(ask(&format!("?token={token}")).contains("200 OK"));
}

/// A child that ends at once, to be asked in the name of another.
fn open_child(folder: &Path) -> Child {
    pathspace(folder).arg("--version").stdout(Stdio::null()).spawn().expect("the binary starts")
}

#[test]
fn pages_and_completions_come_from_the_flags() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let output = pathspace(folder.path()).args(["completions", "bash"]).output().expect("it starts");
    assert!(String::from_utf8_lossy(&output.stdout).contains("--camera-orbit"));
    let output = pathspace(folder.path()).args(["man", "pages"]).output().expect("it starts");
    assert!(String::from_utf8_lossy(&output.stdout).contains("pathspace-render.1"), "{output:?}");
    let page = std::fs::read_to_string(folder.path().join("pages/pathspace-render.1")).expect("written");
    assert!(page.contains("camera\\-orbit"), "{page}");
}
