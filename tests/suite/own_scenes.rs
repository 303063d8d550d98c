//! The scenes that come along to show light by way of mirrors and glass, and round a corner. Oracle: the means in their
//! `expect.toml`, of long runs without light paths, which find the same light by luck, or of another renderer's light
//! tracer.

use std::path::Path;

use pathspace::film::Film;
use pathspace::plan::RenderPlan;
use pathspace::plan::options::{FilterKind, Guiding, RenderOptions};
use pathspace::render::Renderer;
use pathspace::scene::Scene;
use pathspace_stat::Moments;

/// Means over 8 seeds are compared by Student's t with 7 degrees of freedom, which reaches 10.2 once in 10⁵ pictures;
/// what the recipe's own standard error is adds to it.
#[test]
fn caustics_have_the_means_of_their_recipes() {
    for name in ["sun-on-chrome", "lamp-through-glass", "lamp-in-glass", "pool"] {
        let plan = has_the_mean_of_its_recipe(name, Guiding::Auto);
        assert!(plan.features.light_paths, "{name}: the survey takes light paths");
    }
}

/// As above.
#[test]
fn a_room_behind_a_door_has_the_mean_of_its_recipe() {
    let plan = has_the_mean_of_its_recipe("door-ajar", Guiding::On);
    assert!(plan.features.guide && !plan.features.light_paths, "{}", plan.guide_reason);
}

fn has_the_mean_of_its_recipe(name: &str, guiding: Guiding) -> RenderPlan {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
    let recipe = std::fs::read_to_string(folder.join("expect.toml")).expect("a recipe");
    let recipe: toml::Table = recipe.parse().expect("valid TOML");
    let scene = Scene::load(folder.join(recipe["scene"].as_str().expect("a path"))).expect("an own scene loads");
    let numbers = |value: &toml::Value| -> Vec<f64> {
        value.as_array().expect("a list").iter().map(|x| x.as_float().expect("a number")).collect()
    };
    let (mean, error) = (numbers(&recipe["reference"]["mean"]), numbers(&recipe["reference"]["standard_error"]));
    let options = RenderOptions::new(32, 32).spp(32).filter(FilterKind::Box).guiding(guiding);
    let mut renderer = Renderer::new(&scene, options).expect("renders");
    let mut moments = [Moments::default(); 3];
    for seed in 0..8 {
        renderer.set_seed(seed);
        let film: Film = renderer.render().expect("renders").film;
        moments.iter_mut().zip(film.mean()).for_each(|(moments, mean)| moments.push(mean));
    }
    for (c, moments) in moments.iter().enumerate() {
        let own = moments.standard_error();
        let off = (moments.mean - mean[c]).abs();
        assert!(
            off <= 10.2 * own + 4.9 * error[c],
            "{name}, channel {c}: {} ± {own}, recorded {} ± {}",
            moments.mean,
            mean[c],
            error[c]
        );
    }
    renderer.plan().clone()
}
