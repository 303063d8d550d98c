//! Does the ledger know of every disagreement? Each scene of `../shared/scenes` and `../shared/cases` that loads, by
//! the strategies mis, bsdf and light, by every backend that can take it, and in two sizes. Oracle: one expectation, of
//! the picture and of each of its 16 blocks. Strategies may differ where the darker one has an entry in its ledger of
//! biases that the other has not; backends and sizes may not.
//!
//! Statistics. A pixel has two samples of independent numbers, which the film's halves keep one by one. Strategies and
//! backends get the same numbers: what is seen directly is then the same in both, and the differences of single
//! samples, which are independent, have mean 0; their scatter gives the standard error. Sizes share no numbers: theirs
//! is Welch's, from the film's own variances.
//!
//! Rare bright samples. A scatter knows nothing of what has not come yet, so Student's limit would raise alarms. The
//! empirical Bernstein bound (Maurer and Pontil 2009) holds for independent values within a known range: √(2·ln(4/δ))
//! standard errors, 6.2 here (t would ask for 5.9), and 7/3·ln(4/δ)·range/(n − 1). The range is taken to be that of
//! what came anywhere in the picture; with `bsdf` at least the brightest radiance that anything emits, because all
//! samples may miss a small lamp. With `light` nothing bounds what a sharp lobe makes of the few samples in it: scenes
//! with lobes of roughness 0.01 to 0.25 are out of its reach.
//!
//! False alarms: 10⁻⁴ for all comparisons together (Bonferroni), if all random numbers were changed. Power: of the
//! pairs of each sort, most have to be able to show an error of 20 % of the mean; those that cannot are printed. The
//! light that `bsdf` is known to miss has to be missed.

use std::path::{Path, PathBuf};

use glam::Vec3;
use pathspace::backend::{BackendKind, select};
use pathspace::plan::options::{RenderOptions, SamplerKind, Strategy};
use pathspace::render::Renderer;
use pathspace::scene::geometry::Geometry;
use pathspace::scene::{Fact, Facts, Scene};
use pathspace_stat::{Moments, Pcg32};

use crate::common::{options, shared};
use crate::conformance;

/// Chance of a false alarm, of all comparisons together; more than there are of these; and what is left for one.
const FALSE_ALARMS: f64 = 1e-4;
const COMPARISONS: usize = 4096;
const LEVEL: f64 = FALSE_ALARMS / COMPARISONS as f64;

/// Blocks along a side of the picture.
const GRID: usize = 4;

/// Folders, and the sides of their two pictures: the first for strategies, the second for backends. The cases are
/// almost free of noise.
const FOLDERS: [(&str, [u32; 2]); 2] = [("scenes", [192, 96]), ("cases", [96, 48])];

/// Share of the mean that roundings may take: of hits by other triangle tests, of weights that add up to 1.
const ROUNDING: f64 = 1e-4;

/// Share of the mean that a pair has to be able to show.
const VISIBLE: f64 = 0.2;

/// Roughness from which on light samples fall into a lobe often enough for their scatter to show it.
const BROAD: f32 = 0.25;

/// A picture, sample by sample.
struct Picture {
    /// By what it was rendered.
    name: String,
    /// Pixels along a side.
    side: usize,
    /// Two samples a pixel, row by row: means of R, G and B.
    samples: Vec<f64>,
    /// The ledger of its plan.
    ledger: Vec<String>,
    /// The largest sample that may come and need not have come; 0 where nothing is known of it.
    unseen: f64,
}

/// What two pictures differ in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Sort {
    /// Strategies: by the same numbers.
    Strategies,
    /// Sizes: by others.
    Sizes,
    /// Backends: by the same numbers.
    Backends,
}

/// Two means, and how far they may lie apart.
struct Comparison {
    means: [f64; 2],
    allowed: f64,
}

/// What was found.
#[derive(Default)]
struct Tally {
    comparisons: usize,
    /// Pairs that are not black, and those of them that would show an error of [`VISIBLE`], by sort.
    pairs: [[usize; 2]; 3],
    /// Disagreements that the ledger names.
    excused: Vec<String>,
    /// Those that it does not.
    faults: Vec<String>,
}

impl Picture {
    fn take(name: impl Into<String>, renderer: &Renderer, unseen: f64) -> Self {
        let film = renderer.render().unwrap_or_else(|e| panic!("{e}")).film;
        let one_by_one = |pixel: &pathspace::film::Pixel| {
            assert_eq!(pixel.n, [1, 1], "a sample in each half");
            pixel.sum.map(|[r, g, b, _]| (r + g + b) / 3.0)
        };
        Picture {
            name: name.into(),
            side: film.window.width as usize,
            samples: film.pixels.iter().flat_map(one_by_one).collect(),
            ledger: renderer.plan().bias.iter().map(|bias| bias.what.clone()).collect(),
            unseen,
        }
    }

    /// The samples of a block, pixel by pixel; of the whole picture without one.
    fn part(&self, block: Option<usize>) -> impl Iterator<Item = f64> {
        let (x, y, side) = match block {
            None => (0, 0, self.side),
            Some(block) => {
                let side = self.side / GRID;
                (block % GRID * side, block / GRID * side, side)
            }
        };
        (y..y + side).flat_map(move |row| self.samples[2 * (row * self.side + x)..][..2 * side].iter().copied())
    }

    /// Mean of a part, the variance of that mean by the film's halves, and the number of samples.
    fn mean(&self, block: Option<usize>) -> (f64, f64, f64) {
        let (mut sum, mut squares, mut n) = (0.0, 0.0, 0.0);
        let mut samples = self.part(block);
        while let (Some(a), Some(b)) = (samples.next(), samples.next()) {
            sum += a + b;
            squares += (a - b) * (a - b);
            n += 2.0;
        }
        (sum / n, squares / (n * n), n)
    }

    fn largest(&self) -> f64 {
        self.samples.iter().copied().fold(self.unseen, f64::max)
    }
}

impl Comparison {
    /// Of samples by the same numbers, whose differences lie within `range`.
    fn paired([a, b]: [&Picture; 2], block: Option<usize>, range: f64) -> Self {
        let mut differences = Moments::default();
        differences.extend(a.part(block).zip(b.part(block)).map(|(a, b)| a - b));
        let noise = bound(differences.standard_error(), range / (differences.n as f64 - 1.0));
        Comparison::new([a.mean(block).0, b.mean(block).0], noise)
    }

    /// Of samples by different numbers; `largest` are those of the pictures.
    fn independent([a, b]: [&Picture; 2], block: Option<usize>, largest: [f64; 2]) -> Self {
        let ((mean_a, variance_a, n_a), (mean_b, variance_b, n_b)) = (a.mean(block), b.mean(block));
        let rare = largest[0] / (n_a - 1.0) + largest[1] / (n_b - 1.0);
        Comparison::new([mean_a, mean_b], bound((variance_a + variance_b).sqrt(), rare))
    }

    fn new(means: [f64; 2], noise: f64) -> Self {
        Comparison { means, allowed: noise + ROUNDING * means[0].abs() }
    }

    fn agrees(&self) -> bool {
        (self.means[0] - self.means[1]).abs() <= self.allowed
    }
}

/// The empirical Bernstein bound of a mean with that standard error; `rare` is the range of its n values over n − 1.
fn bound(standard_error: f64, rare: f64) -> f64 {
    let log = (4.0 / LEVEL).ln();
    (2.0 * log).sqrt() * standard_error + 7.0 / 3.0 * log * rare
}

impl Tally {
    /// Compares the whole pictures and each block.
    fn judge(&mut self, scene: &str, sort: Sort, [a, b]: [&Picture; 2]) {
        let largest = [a.largest(), b.largest()];
        let unseen = a.unseen.max(b.unseen);
        let range = if sort == Sort::Sizes { 0.0 } else { range_of_differences(a, b).max(unseen) };
        for block in std::iter::once(None).chain((0..GRID * GRID).map(Some)) {
            let found = match sort {
                Sort::Sizes => Comparison::independent([a, b], block, largest),
                Sort::Strategies | Sort::Backends => Comparison::paired([a, b], block, range),
            };
            let Comparison { means, allowed } = found;
            let place = match block {
                None => "the picture".into(),
                Some(block) => format!("block {},{}", block % GRID, block / GRID),
            };
            let told = format!(
                "{scene}, {} against {}, {place}: {:.6} and {:.6}, {:.6} apart, {allowed:.6} allowed",
                a.name,
                b.name,
                means[0],
                means[1],
                (means[0] - means[1]).abs()
            );
            self.comparisons += 1;
            if block.is_none() && means[0] > 0.0 {
                let sees = allowed <= VISIBLE * means[0];
                let [lit, seeing] = &mut self.pairs[sort as usize];
                (*lit, *seeing) = (*lit + 1, *seeing + usize::from(sees));
                if !sees {
                    println!("cannot see {VISIBLE} of the mean: {told}");
                }
            }
            if found.agrees() {
                continue;
            }
            let [darker, other] = if means[0] < means[1] { [a, b] } else { [b, a] };
            match darker.ledger.iter().find(|entry| !other.ledger.contains(entry)) {
                Some(entry) if sort == Sort::Strategies => self.excused.push(format!("{told}: {entry}")),
                _ => self.faults.push(told),
            }
        }
    }
}

/// Largest difference of two samples by the same numbers less the smallest.
fn range_of_differences(a: &Picture, b: &Picture) -> f64 {
    let differences = a.samples.iter().zip(&b.samples).map(|(a, b)| a - b);
    let (low, high) = differences.fold((f64::MAX, f64::MIN), |(low, high), d| (low.min(d), high.max(d)));
    high - low
}

/// The largest radiance that anything emits.
fn brightest(scene: &Scene) -> f64 {
    let mean = |color: Vec3| f64::from(color.element_sum()) / 3.0;
    let lamp = scene.materials.iter().map(|material| mean(material.emissive)).fold(0.0, f64::max);
    let Some(sky) = &scene.environment else { return lamp };
    sky.texels.iter().map(|&texel| mean(texel * sky.intensity)).fold(lamp, f64::max)
}

/// The largest sample of light sampling that need not come: nothing is known of it where a lobe is sharp.
fn unseen_by_light(scene: &Scene) -> f64 {
    let sharp = scene.materials.iter().any(|material| {
        let layer = if material.clearcoat > 0.0 { material.clearcoat_roughness } else { f32::INFINITY };
        Facts::of(material).has(Fact::Rough) && material.roughness.min(layer) < BROAD
    });
    if sharp { f64::INFINITY } else { 0.0 }
}

/// Whether a backend may be asked and can take the scene. For `brute` they are too large.
fn takes(kind: BackendKind, geometry: &Geometry) -> bool {
    let can = match kind {
        BackendKind::Brute => false,
        BackendKind::Flat => select::few_faces(geometry).is_some(),
        _ => kind.traces(geometry),
    };
    can && !conformance::is_skipped(kind)
}

/// All glTF files below `folder`, in the order of their names.
fn scenes_in(folder: &Path) -> Vec<PathBuf> {
    let mut entries: Vec<PathBuf> =
        std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path()).collect();
    entries.sort();
    let is_scene = |path: &Path| path.extension().is_some_and(|extension| extension == "gltf" || extension == "glb");
    let below = |path: PathBuf| if path.is_dir() { scenes_in(&path) } else { vec![path] };
    entries.into_iter().filter(|path| path.is_dir() || is_scene(path)).flat_map(below).collect()
}

/// A scene under the sky beside it, if there is one; `None` with a message if it does not load.
fn load(file: &Path) -> Option<Scene> {
    let mut scene = match Scene::load(file) {
        Ok(scene) => scene,
        Err(error) => {
            eprintln!("SKIPPED {}: {error}", file.display());
            return None;
        }
    };
    let skies = [file.with_extension("env.exr"), file.with_file_name("right-half.exr")];
    if let Some(sky) = skies.iter().find(|sky| sky.is_file()) {
        scene.load_environment(sky, 0.0, 1.0).unwrap_or_else(|e| panic!("{e}"));
    }
    Some(scene)
}

/// Renders a scene in every way, `first` with every strategy and in both sizes.
fn compare_all(tally: &mut Tally, name: &str, scene: &Scene, first: BackendKind, [large, small]: [u32; 2]) {
    let asked = |side: u32, kind: BackendKind, seed: u64| -> RenderOptions {
        options(side, side, 2).sampler(SamplerKind::Independent).backend(kind).seed(seed)
    };
    let build = |options| Renderer::new(scene, options).unwrap_or_else(|e| panic!("{name}: {e}"));
    let (one, other) = (1, 2);

    let mut renderer = build(asked(large, first, one));
    let mis = Picture::take("mis", &renderer, 0.0);
    for (strategy, unseen) in [(Strategy::BSDF, brightest(scene)), (Strategy::LIGHT, unseen_by_light(scene))] {
        let options = asked(large, first, one).strategy(strategy);
        renderer.retarget(&options).unwrap_or_else(|e| panic!("{name}: {e}"));
        let picture = Picture::take(strategy.name(), &renderer, unseen);
        tally.judge(name, Sort::Strategies, [&mis, &picture]);
    }

    renderer.retarget(&asked(small, first, other)).unwrap_or_else(|e| panic!("{name}: {e}"));
    let smaller = Picture::take(format!("{} at {small}²", first.name()), &renderer, 0.0);
    tally.judge(name, Sort::Sizes, [&mis, &smaller]);

    let is_other = |kind: &BackendKind| *kind != first && takes(*kind, renderer.geometry());
    let others: Vec<BackendKind> = BackendKind::ALL.into_iter().filter(is_other).collect();
    drop(renderer);
    for kind in others {
        let picture = Picture::take(kind.name(), &build(asked(small, kind, other)), 0.0);
        tally.judge(name, Sort::Backends, [&smaller, &picture]);
    }
}

#[test]
fn disagreements_are_in_the_ledger() {
    let Some(shared) = shared("disagreements on the shared scenes and cases") else { return };
    let usable = |kind: &&BackendKind| **kind != BackendKind::Brute && !conformance::is_skipped(**kind);
    let Some(&first) = BackendKind::available().iter().find(usable) else {
        eprintln!("SKIPPED disagreements: PATHSPACE_SKIP_BACKENDS leaves no backend that takes every scene");
        return;
    };
    let (mut tally, mut loaded) = (Tally::default(), 0);
    for (folder, sides) in FOLDERS {
        for file in scenes_in(&shared.join(folder)) {
            let Some(scene) = load(&file) else { continue };
            let name = file.strip_prefix(&shared).unwrap_or(&file).display().to_string();
            compare_all(&mut tally, &name, &scene, first, sides);
            loaded += 1;
        }
    }
    let Tally { comparisons, pairs, excused, faults } = tally;
    println!("{loaded} scenes, {comparisons} comparisons; by the ledger:\n{}", excused.join("\n"));
    assert!(faults.is_empty(), "disagreements that no ledger names:\n{}", faults.join("\n"));

    // A test that sees nothing proves nothing.
    assert!(loaded >= 20 && comparisons <= COMPARISONS, "{loaded} scenes, {comparisons} comparisons");
    for sort in [Sort::Strategies, Sort::Sizes, Sort::Backends] {
        let [lit, seeing] = pairs[sort as usize];
        println!("{sort:?}: {seeing} of {lit} pairs can show an error of {VISIBLE} of the mean");
        assert!(2 * seeing >= lit, "{sort:?}: only {seeing} of {lit} pairs can show one");
    }
    for case in ["medium-shadow-rays/point.gltf", "spot-angles-f32/spot.gltf"] {
        let missed = excused.iter().any(|told| told.contains(case) && told.contains("punctual"));
        assert!(missed, "{case}: bsdf should miss its only light");
    }
}

/// A picture by hand.
fn by_hand(ledger: &[&str], unseen: f64, sample: impl FnMut(usize) -> f64) -> Picture {
    let (side, name) = (48, "a picture by hand".into());
    let ledger = ledger.iter().map(|entry| entry.to_string()).collect();
    Picture { name, side, samples: (0..2 * side * side).map(sample).collect(), ledger, unseen }
}

/// Excuses are the darker picture's own entries, and strategies' only. Oracle: by hand. Deterministic.
#[test]
fn only_an_own_entry_of_the_darker_strategy_excuses() {
    let wave = |i: usize| 1.0 + 0.5 * (i as f64).sin();
    let verdict = |bright: &[&str], dark: &[&str], sort: Sort| {
        let (a, b) = (by_hand(bright, 0.0, wave), by_hand(dark, 0.0, |i| 0.8 * wave(i)));
        let mut tally = Tally::default();
        tally.judge("by hand", sort, [&a, &b]);
        (tally.faults.len(), tally.excused.len())
    };
    let all = 1 + GRID * GRID;
    assert_eq!(verdict(&["max-depth 64"], &["max-depth 64"], Sort::Strategies), (all, 0));
    assert_eq!(verdict(&["max-depth 64"], &["max-depth 64", "no lamps"], Sort::Strategies), (0, all));
    assert_eq!(verdict(&["max-depth 64", "no lamps"], &["max-depth 64"], Sort::Strategies), (all, 0));
    assert_eq!(verdict(&[], &["no lamps"], Sort::Backends), (all, 0));
}

/// Light that one picture has everywhere and the other in 1 to 64 bright samples, of which any number may come. Oracle:
/// equal by construction; each draw's false-alarm rate is at most that of 17 comparisons, 4·10⁻⁷.
#[test]
fn rare_samples_raise_no_alarm() {
    let mut random = Pcg32::new(5, 1);
    let n = (2 * 48 * 48) as f64;
    for expected in [1.0, 4.0, 16.0, 64.0] {
        for _ in 0..50 {
            let even = by_hand(&[], 0.0, |_| expected / n);
            let rare = by_hand(&[], 1.0, |_| f64::from(u8::from(random.next_f64() * n < expected)));
            let mut tally = Tally::default();
            tally.judge("by hand", Sort::Strategies, [&even, &rare]);
            assert!(tally.faults.is_empty(), "{expected}: {:?}", tally.faults);
        }
    }
}
