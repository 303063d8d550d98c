//! Pages as a browser shows them: the live page, led by mouse and sliders, and the written ones. Oracles: the EXR of
//! the same render, the tone curves of previews, and the command line of the page, run. Needs Chromium (`make
//! test-browser`); what clients without a script meet is in `live.rs` and `pages.rs`. Deterministic.

mod chromium;

use std::path::Path;
use std::time::{Duration, Instant};

use pathspace::film::exr::{Picture, read_exr};
use pathspace::film::look::srgb_byte;
use pathspace::film::tone::ToneMap;
use serde_json::json;

use self::chromium::Browser;
use crate::live::{Running, cornell_box, pathspace};

const SIZE: (usize, usize) = (48, 36);

/// What the canvas shows: R, G, B of each pixel.
fn canvas(browser: &mut Browser) -> Vec<[u8; 3]> {
    // Read from a copy: a canvas that is read again and again is drawn by other means, with a warning.
    let bytes = browser.value(
        "(c => { const copy = Object.assign(document.createElement('canvas'), {width: c.width, height: c.height});\
         const at = copy.getContext('2d', {willReadFrequently: true}); at.drawImage(c, 0, 0);\
         return Array.from(at.getImageData(0, 0, c.width, c.height).data); })(document.querySelector('canvas'))",
    );
    let byte = |value: &serde_json::Value| value.as_u64().expect("a byte") as u8;
    let bytes = bytes.as_array().expect("bytes");
    bytes.chunks_exact(4).map(|pixel| [byte(&pixel[0]), byte(&pixel[1]), byte(&pixel[2])]).collect()
}

/// Waits until the view that was asked for is complete and on the canvas.
fn settle(browser: &mut Browser) {
    // A view that has just been sent is not that of the state at hand.
    browser.until("!sending && (told === null || JSON.stringify(state.view) === JSON.stringify(told))");
    browser.until("state.done && shown === state.version && !asking && document.body.dataset.version == shown");
}

/// The picture that "save EXR" gives.
fn saved(browser: &mut Browser, folder: &Path) -> Picture {
    let path = folder.join("picture.exr");
    let _ = std::fs::remove_file(&path);
    browser.value("document.getElementById('save').click()");
    let started = Instant::now();
    while !path.exists() {
        assert!(started.elapsed() < Duration::from_secs(30), "nothing was saved");
        browser.value("1");
        std::thread::sleep(Duration::from_millis(20));
    }
    let picture = read_exr(&path).expect("a picture");
    assert_eq!((picture.width, picture.height), SIZE);
    picture
}

/// Runs the command line of the page and holds its picture to the one that the page shows, in every bit.
fn reproduce(browser: &mut Browser, folder: &Path) -> String {
    let line = browser.text("document.getElementById('command').textContent");
    let words: Vec<&str> = line.split(' ').skip(1).chain(["-q", "-o", "same.exr"]).collect();
    assert!(pathspace(folder).args(&words).status().expect("it starts").success(), "{line}");
    let same = read_exr(&folder.join("same.exr")).expect("just written");
    let shown = saved(browser, folder);
    assert!(same.rgb == shown.rgb, "{line}: another picture");
    line
}

#[test]
#[ignore = "needs Chromium: make test-browser"]
fn a_view_is_led_by_hand() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    let scene = cornell_box();
    let scene = scene.to_str().expect("a plain name");
    let options = ["--address", "127.0.0.1:0", "--size", "48x36", "-s", "16", "--env", "studio"];
    let view = Running::start(folder, &[&["view", scene][..], &options].concat());
    let mut browser = Browser::start((1280, 800));
    let downloads = json!({"behavior": "allow", "downloadPath": folder});
    browser.call("Browser.setDownloadBehavior", downloads);
    browser.open(&format!("http://{}/", view.address));
    browser.until("state.done === true");
    settle(&mut browser);

    // The canvas is the EXR under each tone curve.
    let exr = saved(&mut browser, folder);
    for (curve, ev) in [(ToneMap::Neutral, 0.0), (ToneMap::Agx, 0.0), (ToneMap::Clip, 0.0), (ToneMap::Neutral, 1.5)] {
        browser.set("tone", curve.name());
        browser.set("exposure", &ev.to_string());
        let gain = f64::exp2(ev);
        for (i, (shown, rgb)) in canvas(&mut browser).iter().zip(&exr.rgb).enumerate() {
            let expected = curve.apply(rgb.map(|value| f64::from(value) * gain)).map(srgb_byte);
            let near = shown.iter().zip(expected).all(|(a, b)| a.abs_diff(b) <= 1);
            assert!(near, "{curve} at {ev} EV, pixel {i}: {shown:?} instead of {expected:?}");
        }
    }
    assert!(browser.text("line()").ends_with("--exposure=1.5 --tone-map neutral"));
    browser.set("exposure", "0");

    // The pixel under the pointer, on the zoomed picture too.
    for wheel in [0, -300] {
        let at = browser.value(
            "(b => [b.left + place.x + 20.5 * place.zoom, b.top + place.y + 10.5 * place.zoom])\
                                (stage.getBoundingClientRect())",
        );
        let at = (at[0].as_f64().expect("x"), at[1].as_f64().expect("y"));
        let zoom = browser.value("place.zoom");
        browser.call(
            "Input.dispatchMouseEvent",
            json!({"type": "mouseWheel", "x": at.0, "y": at.1, "deltaX": 0, "deltaY": wheel}),
        );
        assert_eq!(browser.value("place.zoom") == zoom, wheel == 0);
        browser.mouse("mouseMoved", (at.0 + 0.1, at.1), 0);
        let said = browser.text("document.getElementById('pixel').textContent");
        assert!(said.starts_with("20, 10\n") && said.contains("± "), "{said}");
        let numbers = said.lines().nth(1).expect("values").split_whitespace().filter_map(|word| word.parse().ok());
        for (number, value) in numbers.zip(exr.rgb[10 * SIZE.0 + 20]) {
            let number: f32 = number;
            assert!((number - value).abs() <= 1e-3 * value, "{said} instead of {value}");
        }
        browser.mouse("mousePressed", at, 1);
        browser.mouse("mouseReleased", at, 0);
        browser.until("story.textContent.startsWith('pixel 20,10 sample 0: camera ray')");
    }
    browser.value("document.getElementById('after').click()");
    browser.until("story.textContent.startsWith('pixel 20,10 sample 1: camera ray')");
    browser.value("document.getElementById('fit').click()");

    // Maps and layers. One that was not gathered begins the render again with it.
    browser.set("map", "error");
    browser.until("document.body.dataset.map === 'error' && !legend.hidden");
    browser.set("map", "layer:spp");
    browser.until("document.body.dataset.map === 'layer:spp' && legend.textContent.includes('16')");
    browser.set("map", "beyond:albedo");
    browser.until("document.body.dataset.map === 'layer:albedo'");
    settle(&mut browser);
    let line = reproduce(&mut browser, folder);
    assert!(line.ends_with("--aov albedo --tone-map neutral") && !line.contains("--camera-orbit"), "{line}");
    browser.set("map", "picture");

    // Turned by the mouse, moved nearer, with an open lens under a turned sky.
    let before = canvas(&mut browser);
    browser.drag((400.0, 400.0), (470.0, 430.0));
    settle(&mut browser);
    assert!(canvas(&mut browser) != before, "another camera sees another picture");
    let shift_wheel = json!({"type": "mouseWheel", "x": 400, "y": 400, "deltaX": 0, "deltaY": -100, "modifiers": 8});
    browser.call("Input.dispatchMouseEvent", shift_wheel);
    browser.set("aperture", "0.4");
    browser.set("rotation", "30");
    settle(&mut browser);
    let line = reproduce(&mut browser, folder);
    for option in ["--camera-orbit=", "--look-at=", "--aperture-radius ", "--focus-distance ", "--env-rotation=30"] {
        assert!(line.contains(option), "{line}");
    }
    browser.value("document.getElementById('home').click()");
    settle(&mut browser);
    assert!(canvas(&mut browser) == before, "the picture of the start");

    // What else is told; nothing went wrong on the way; and nobody there is told as well.
    for (id, word) in
        [("ledger", "max-depth 64"), ("plan", "traced by"), ("curve", "polyline"), ("left", "after about")]
    {
        let markup = browser.text(&format!("document.getElementById('{id}').innerHTML"));
        assert!(markup.contains(word) || id == "plan", "{id}: {markup}");
    }
    assert!(browser.problems.is_empty(), "{:#?}", browser.problems);
    drop(view);
    browser.until("!document.getElementById('lost').hidden");
}

#[test]
#[ignore = "needs Chromium: make test-browser"]
fn written_pages_are_whole_at_every_width() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    let scene = cornell_box();
    let scene = scene.to_str().expect("a plain name");
    let common = ["--size", "48x36", "-s", "16", "-q"];
    let report = ["render", scene, "-o", "a.exr", "--report", "a.html", "--aov", "albedo,Z,bounces"];
    assert!(pathspace(folder).args(report).args(common).status().is_ok_and(|status| status.success()));
    let other = ["render", scene, "-o", "b.exr", "--seed", "1"];
    assert!(pathspace(folder).args(other).args(common).status().is_ok_and(|status| status.success()));
    assert!(pathspace(folder).args(["compare", "a.exr", "b.exr", "--html", "b.html"]).output().is_ok());

    let mut browser = Browser::start((1280, 800));
    for (page, pictures) in [("a.html", 5), ("b.html", 4)] {
        browser.open(&format!("file://{}/{page}", folder.display()));
        for width in [1280, 400] {
            browser.resize((width, 800));
            let over = browser.value("document.documentElement.scrollWidth - document.documentElement.clientWidth");
            assert_eq!(over, 0, "{page} at {width}");
        }
        browser
            .until(&format!("document.images.length >= {pictures} && [...document.images].every(i => i.naturalWidth)"));
    }
    // The pictures that are compared are switched by keys and buttons.
    let seen = "[...document.querySelectorAll('.stack figure')].findIndex(figure => !figure.hidden)";
    for (key, at) in [("3", 2), ("f", 0), ("f", 1)] {
        browser.value(&format!("dispatchEvent(new KeyboardEvent('keydown', {{key: '{key}'}}))"));
        assert_eq!(browser.value(seen), at, "{key}");
    }
    assert!(browser.problems.is_empty(), "{:#?}", browser.problems);
}
