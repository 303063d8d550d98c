//! The scenes of the suite, made in code: of many shapes and sizes, and none of them what a backend was written for.
//! Numbers are drawn from fixed seeds. Lengths in metres; everything is white and matte.

use glam::{Affine3A, Quat, Vec2, Vec3};

use crate::scene::builder::SceneBuilder;
use crate::scene::{Environment, MaterialId, Mesh, MeshId, Scene};

/// A scene of the suite.
#[derive(Clone, Copy, Debug)]
pub struct Entry {
    /// Its name.
    pub name: &'static str,
    /// Triangles over all placements, about.
    pub about: u64,
    /// Makes it.
    pub make: fn() -> Scene,
}

const fn entry(name: &'static str, about: u64, make: fn() -> Scene) -> Entry {
    Entry { name, about, make }
}

/// All scenes, small ones first. Weights are fitted to every other one, from the first on, and tested on the rest.
pub const ALL: [Entry; 26] = [
    entry("boxes-in-the-open", 100, || open_boxes(8)),
    entry("room-of-8-boxes", 110, || room_of_boxes(8)),
    entry("room-of-30-boxes", 370, || room_of_boxes(30)),
    entry("pavilion", 600, pavilion),
    entry("room-of-100-boxes", 1_200, || room_of_boxes(100)),
    entry("boxes-in-a-void", 1_200, void),
    entry("terrain-8k", 8_200, || terrain(64)),
    entry("room-of-900-boxes", 11_000, || room_of_boxes(900)),
    entry("soup-10k", 10_000, || soup(10_000, 0.1, false)),
    entry("city-20k", 19_000, || city(40, 1)),
    entry("floor-with-things", 32_000, floor_with_things),
    entry("room-with-a-scan", 35_000, || room_with_scan(94)),
    entry("room-of-balls", 54_000, || room_of_balls(10)),
    entry("columns", 66_000, columns),
    entry("shells", 80_000, shells),
    entry("scan-130k", 130_000, || scan(180)),
    entry("hair-160k", 160_000, || hair(10_000, 8)),
    entry("room-of-soup", 100_000, || soup(100_000, 0.03, true)),
    entry("room-with-hair", 130_000, room_with_hair),
    entry("room-of-plants", 400_000, room_of_plants),
    entry("city-300k", 310_000, || city(60, 7)),
    entry("terrain-500k", 524_000, || terrain(512)),
    entry("scan-1m", 1_000_000, || scan(500)),
    entry("forest-5m", 5_000_000, forest),
    entry("terrain-8m", 8_400_000, || terrain(2048)),
    entry("scan-10m", 10_000_000, || scan(1582)),
];

/// A scene under construction.
struct Maker {
    builder: SceneBuilder,
    random: u64,
    white: MaterialId,
}

impl Maker {
    fn new(seed: u64) -> Self {
        let mut builder = SceneBuilder::new();
        let white = builder.lambert(Vec3::splat(0.7));
        Maker { builder, random: seed, white }
    }

    /// In [0, 1).
    fn unit(&mut self) -> f32 {
        self.random = self.random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.random >> 40) as f32 / (1 << 24) as f32
    }

    fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.unit()
    }

    fn point(&mut self, low: Vec3, high: Vec3) -> Vec3 {
        low + (high - low) * Vec3::new(self.unit(), self.unit(), self.unit())
    }

    /// A closed box with a lamp below its ceiling, seen from inside.
    fn room(&mut self, half: Vec3) {
        self.builder.cuboid(-half, half, true, self.white);
        let lamp = self.builder.emitter(Vec3::ZERO, Vec3::splat(10.0));
        let corners = [(-0.3, -0.3), (0.3, -0.3), (0.3, 0.3), (-0.3, 0.3)];
        self.builder.quad(corners.map(|(x, z)| Vec3::new(x * half.x, 0.99 * half.y, z * half.z)), lamp);
        self.look(Vec3::new(0.0, 0.1, 0.95) * half, Vec3::new(0.0, -0.3, 0.0) * half, 1.1);
    }

    fn look(&mut self, eye: Vec3, target: Vec3, fov: f32) {
        self.builder.camera(eye, target, Vec3::Y, fov);
    }

    fn sky(&mut self) {
        self.builder.environment(Environment::constant(Vec3::ONE));
    }

    fn floor(&mut self, half: f32) {
        let corners = [(-half, half), (half, half), (half, -half), (-half, -half)];
        self.builder.quad(corners.map(|(x, z)| Vec3::new(x, 0.0, z)), self.white);
    }

    /// Boxes that stand on y = `ground`, turned about the vertical.
    fn boxes(&mut self, count: u32, ground: f32, reach: f32, sizes: (f32, f32)) {
        for _ in 0..count {
            let half = self.point(Vec3::splat(0.5 * sizes.0), Vec3::splat(0.5 * sizes.1));
            let (x, z) = (self.between(-reach, reach), self.between(-reach, reach));
            let turn = Quat::from_rotation_y(self.between(0.0, 1.5));
            let at = Vec3::new(x, ground + half.y + 1e-3 * self.unit(), z);
            let mesh = box_mesh(&mut self.builder, half, self.white);
            self.builder.place(mesh, Affine3A::from_rotation_translation(turn, at));
        }
    }

    /// A ball with bumps of many sizes, as a scan has them: 4·rows² triangles.
    fn ball(&mut self, rows: u32) -> MeshId {
        let columns = 2 * rows;
        let mut waves = Vec::new();
        for octave in 0..6 {
            let scale = (1 << octave) as f32;
            for _ in 0..4 {
                let way = self.point(Vec3::NEG_ONE, Vec3::ONE) * (3.0 * scale);
                waves.push((way, self.between(0.0, 6.0), 0.05 / scale));
            }
        }
        let position = |row: u32, column: u32| {
            let (phi, theta) = (
                row as f32 / rows as f32 * std::f32::consts::PI,
                (column % columns) as f32 / rows as f32 * std::f32::consts::PI,
            );
            let ring = if row == 0 || row == rows { 0.0 } else { phi.sin() };
            let dir = Vec3::new(ring * theta.sin(), phi.cos(), ring * theta.cos());
            dir * (1.0 + waves.iter().map(|(way, start, size)| size * (way.dot(dir) + start).sin()).sum::<f32>())
        };
        let positions = (0..=rows).flat_map(|row| (0..columns).map(move |c| (row, c))).map(|(r, c)| position(r, c));
        let triangles = grid(rows, columns, |row, column| row * columns + column % columns);
        self.builder.mesh(positions.collect(), triangles, self.white)
    }

    fn place(&mut self, mesh: MeshId, at: Vec3, size: f32) {
        let turn = Quat::from_rotation_y(self.between(0.0, 6.0));
        self.builder.place(mesh, Affine3A::from_scale_rotation_translation(Vec3::splat(size), turn, at));
    }

    /// Leaves of two triangles around a trunk, one unit high.
    fn plant(&mut self, leaves: u32) -> MeshId {
        let mut mesh = Mesh { name: "plant".into(), material: self.white, ..Mesh::default() };
        for _ in 0..leaves {
            let height = self.between(0.2, 1.0);
            let crown = 0.4 * (1.0 - height) + 0.05;
            let at = Vec3::new(self.between(-crown, crown), height, self.between(-crown, crown));
            let (u, v) = (self.point(Vec3::NEG_ONE, Vec3::ONE), self.point(Vec3::NEG_ONE, Vec3::ONE));
            quad(&mut mesh, at, 0.02 * u, 0.01 * v);
        }
        quad(&mut mesh, Vec3::Y * 0.3, Vec3::Y * 0.3, Vec3::X * 0.01);
        quad(&mut mesh, Vec3::Y * 0.3, Vec3::Y * 0.3, Vec3::Z * 0.01);
        self.builder.full_mesh(mesh)
    }

    /// Strands of a square section's two sides, bent, that grow from a ball of radius `from`.
    fn strands(&mut self, count: u32, segments: u32, from: f32) -> MeshId {
        let mut mesh = Mesh { name: "hair".into(), material: self.white, ..Mesh::default() };
        for _ in 0..count {
            let dir = self.point(Vec3::NEG_ONE, Vec3::ONE).normalize_or(Vec3::Y);
            let bend = self.point(Vec3::NEG_ONE, Vec3::ONE) * 0.3 - Vec3::Y * 0.3;
            let across = dir.cross(bend).normalize_or(Vec3::X) * 0.001;
            let first = mesh.positions.len() as u32;
            for i in 0..=segments {
                let t = i as f32 / segments as f32;
                let at = dir * (from + 0.5 * t) + bend * (t * t);
                mesh.positions.extend([at - across, at + across]);
            }
            for i in 0..segments {
                let a = first + 2 * i;
                mesh.triangles.extend([[a, a + 1, a + 2], [a + 1, a + 3, a + 2]]);
            }
        }
        self.builder.full_mesh(mesh)
    }

    fn done(self) -> Scene {
        self.builder.build()
    }
}

/// Two triangles a cell.
fn grid(rows: u32, columns: u32, vertex: impl Fn(u32, u32) -> u32) -> Vec<[u32; 3]> {
    let cells = (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column)));
    cells
        .flat_map(|(row, column)| {
            let [a, b] = [vertex(row, column), vertex(row, column + 1)];
            let [c, d] = [vertex(row + 1, column), vertex(row + 1, column + 1)];
            [[a, c, b], [b, c, d]]
        })
        .collect()
}

fn quad(mesh: &mut Mesh, center: Vec3, u: Vec3, v: Vec3) {
    let first = mesh.positions.len() as u32;
    mesh.positions.extend([center - u - v, center + u - v, center + u + v, center - u + v]);
    mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
}

fn box_mesh(builder: &mut SceneBuilder, half: Vec3, material: MaterialId) -> MeshId {
    let mut mesh = Mesh { name: "box".into(), material, ..Mesh::default() };
    let sides = [(Vec3::X, Vec3::Y, Vec3::Z), (Vec3::Y, Vec3::Z, Vec3::X), (Vec3::Z, Vec3::X, Vec3::Y)];
    for (n, u, v) in sides {
        quad(&mut mesh, n * half, u * half, v * half);
        quad(&mut mesh, -n * half, v * half, u * half);
    }
    builder.full_mesh(mesh)
}

fn open_boxes(count: u32) -> Scene {
    let mut m = Maker::new(1);
    m.boxes(count, 0.0, 1.5, (0.3, 1.0));
    m.floor(4.0);
    m.sky();
    m.look(Vec3::new(0.0, 1.5, 4.0), Vec3::Y * 0.3, 0.8);
    m.done()
}

fn room_of_boxes(count: u32) -> Scene {
    let mut m = Maker::new(2);
    let size = 1.5 / (count as f32).sqrt();
    m.room(Vec3::splat(1.0));
    m.boxes(count, -1.0, 0.85, (0.4 * size, 1.2 * size));
    m.done()
}

/// A roof on columns of many sides, open to the sky.
fn pavilion() -> Scene {
    let mut m = Maker::new(3);
    m.floor(5.0);
    let white = m.white;
    m.builder.cuboid(Vec3::new(-2.2, 2.0, -2.2), Vec3::new(2.2, 2.2, 2.2), false, white);
    for i in 0..16 {
        let (a, b) = (i % 4, i / 4);
        column(&mut m, Vec3::new(a as f32 * 1.3 - 1.95, 0.0, b as f32 * 1.3 - 1.95), 0.15, 2.0, (18, 1));
    }
    m.sky();
    m.look(Vec3::new(1.0, 1.2, 6.0), Vec3::Y, 0.8);
    m.done()
}

/// An open tube.
fn column(m: &mut Maker, foot: Vec3, radius: f32, height: f32, (sides, rings): (u32, u32)) {
    let around = |side: u32| Vec2::from_angle(side as f32 / sides as f32 * std::f32::consts::TAU) * radius;
    let all = (0..=rings).flat_map(|ring| (0..sides).map(move |side| (ring, side)));
    let positions = all.map(|(ring, side)| {
        let (at, swell) = (around(side), 1.0 + 0.1 * (ring as f32).sin());
        foot + Vec3::new(at.x * swell, height * ring as f32 / rings as f32, at.y * swell)
    });
    let triangles = grid(rings, sides, |ring, side| ring * sides + side % sides);
    let mesh = m.builder.mesh(positions.collect(), triangles, m.white);
    m.builder.place(mesh, Affine3A::IDENTITY);
}

/// Small things, far from each other and from the walls around all.
fn void() -> Scene {
    let mut m = Maker::new(4);
    m.room(Vec3::splat(100.0));
    m.boxes(100, -2.0, 4.0, (0.1, 1.0));
    m.look(Vec3::new(0.0, 1.0, 9.0), Vec3::NEG_Y, 0.8);
    let mut scene = m.done();
    scene.cameras.remove(0);
    scene
}

fn terrain(n: u32) -> Scene {
    let mut m = Maker::new(5);
    let mut waves = Vec::new();
    for octave in 0..8 {
        let scale = (1 << octave) as f32;
        for _ in 0..3 {
            let way = Vec2::new(m.between(-1.0, 1.0), m.between(-1.0, 1.0)) * scale;
            waves.push((way, m.between(0.0, 6.0), 0.5 / scale));
        }
    }
    let all = (0..=n).flat_map(|z| (0..=n).map(move |x| (x, z)));
    let positions = all.map(|(x, z)| {
        let at = Vec2::new(x as f32, z as f32) * (20.0 / n as f32) - 10.0;
        Vec3::new(at.x, waves.iter().map(|(way, start, high)| high * (way.dot(at) + start).sin()).sum(), at.y)
    });
    let triangles = grid(n, n, |row, column| row * (n + 1) + column);
    let mesh = m.builder.mesh(positions.collect(), triangles, m.white);
    m.builder.place(mesh, Affine3A::IDENTITY);
    m.sky();
    m.look(Vec3::new(0.0, 4.0, 11.0), Vec3::ZERO, 0.8);
    m.done()
}

/// Triangles anywhere, in a room or not.
fn soup(count: u32, size: f32, walls: bool) -> Scene {
    let mut m = Maker::new(6);
    let mut mesh = Mesh { name: "soup".into(), material: m.white, ..Mesh::default() };
    for i in 0..count {
        let at = m.point(Vec3::splat(-0.9), Vec3::splat(0.9));
        for _ in 0..3 {
            let corner = m.point(Vec3::NEG_ONE, Vec3::ONE);
            mesh.positions.push(at + size * corner);
        }
        mesh.triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
    }
    let mesh = m.builder.full_mesh(mesh);
    if walls {
        m.room(Vec3::new(4.0, 3.0, 4.0));
    } else {
        m.sky();
        m.look(Vec3::new(0.0, 0.0, 3.5), Vec3::ZERO, 0.7);
    }
    m.place(mesh, Vec3::ZERO, 1.0);
    m.done()
}

/// Houses in blocks; each of `floors` storeys that stand out a little.
fn city(n: u32, floors: u32) -> Scene {
    let mut m = Maker::new(7);
    m.floor(n as f32);
    for i in 0..n * n {
        let at = Vec3::new((i % n) as f32, 0.0, (i / n) as f32) * 1.5 - Vec3::new(1.0, 0.0, 1.0) * (0.75 * n as f32);
        let (height, side) = (m.between(0.5, 4.0), m.between(0.3, 0.55));
        for floor in 0..floors {
            let inset = if floor % 2 == 0 { 1.0 } else { 0.9 };
            let half = Vec3::new(side * inset, 0.5 * height / floors as f32, side * inset);
            let mesh = box_mesh(&mut m.builder, half, m.white);
            let up = Vec3::Y * (height * (floor as f32 + 0.5) / floors as f32);
            m.builder.place(mesh, Affine3A::from_translation(at + up));
        }
    }
    m.sky();
    m.look(Vec3::new(0.0, 6.0, 0.75 * n as f32), Vec3::ZERO, 0.9);
    m.done()
}

fn floor_with_things() -> Scene {
    let mut m = Maker::new(8);
    m.floor(30.0);
    m.boxes(200, 0.0, 8.0, (0.05, 0.4));
    for _ in 0..60 {
        let ball = m.ball(11);
        let (x, z) = (m.between(-8.0, 8.0), m.between(-8.0, 8.0));
        m.place(ball, Vec3::new(x, 0.3, z), 0.25);
    }
    m.sky();
    m.look(Vec3::new(0.0, 2.5, 11.0), Vec3::ZERO, 0.8);
    m.done()
}

fn room_with_scan(rows: u32) -> Scene {
    let mut m = Maker::new(9);
    m.room(Vec3::new(2.0, 1.2, 2.0));
    let ball = m.ball(rows);
    m.place(ball, Vec3::new(0.2, -0.6, 0.0), 0.45);
    m.boxes(3, -1.2, 1.5, (0.3, 0.8));
    m.done()
}

fn room_of_balls(rows: u32) -> Scene {
    let mut m = Maker::new(10);
    m.room(Vec3::splat(1.0));
    for _ in 0..135 {
        let ball = m.ball(rows);
        let (at, size) = (m.point(Vec3::splat(-0.85), Vec3::splat(0.85)), m.between(0.05, 0.09));
        m.place(ball, at, size);
    }
    m.done()
}

/// A hall: walls around rows of columns.
fn columns() -> Scene {
    let mut m = Maker::new(11);
    m.room(Vec3::new(10.0, 3.0, 10.0));
    for i in 0..64 {
        let at = Vec3::new((i % 8) as f32 * 2.2 - 7.7, -3.0, (i / 8) as f32 * 2.2 - 7.9);
        column(&mut m, at, 0.3, 6.0, (32, 16));
    }
    m.done()
}

/// Balls inside balls, each with three of four cells left out.
fn shells() -> Scene {
    let mut m = Maker::new(12);
    for shell in 0..8 {
        let rows = 100;
        let radius = 0.5 + 0.25 * shell as f32;
        let all = (0..=rows).flat_map(|row| (0..=2 * rows).map(move |column| (row, column)));
        let positions = all.map(|(row, column)| {
            let (sin, cos) = (row as f32 / rows as f32 * std::f32::consts::PI).sin_cos();
            let ring = Vec2::from_angle(column as f32 / rows as f32 * std::f32::consts::PI) * sin;
            Vec3::new(ring.x, cos, ring.y) * radius
        });
        let cells = grid(rows, 2 * rows, |row, column| row * (2 * rows + 1) + column);
        // Four cells are eight triangles.
        let kept = cells.chunks_exact(8).flat_map(|four| [four[0], four[1]]).collect();
        let mesh = m.builder.mesh(positions.collect(), kept, m.white);
        m.place(mesh, Vec3::ZERO, 1.0);
    }
    m.sky();
    m.look(Vec3::new(0.0, 0.5, 6.0), Vec3::ZERO, 0.8);
    m.done()
}

fn scan(rows: u32) -> Scene {
    let mut m = Maker::new(13);
    let ball = m.ball(rows);
    m.place(ball, Vec3::Y, 1.0);
    m.floor(3.0);
    m.sky();
    m.look(Vec3::new(0.0, 1.5, 3.5), Vec3::Y, 0.8);
    m.done()
}

fn hair(strands: u32, segments: u32) -> Scene {
    let mut m = Maker::new(14);
    let hair = m.strands(strands, segments, 0.5);
    m.place(hair, Vec3::ZERO, 1.0);
    m.sky();
    m.look(Vec3::new(0.0, 0.3, 2.6), Vec3::ZERO, 0.8);
    m.done()
}

fn room_with_hair() -> Scene {
    let mut m = Maker::new(15);
    m.room(Vec3::new(2.0, 1.5, 2.0));
    let (hair, ball) = (m.strands(6_000, 8, 0.5), m.ball(90));
    m.place(hair, Vec3::new(-0.6, -0.7, 0.0), 0.7);
    m.place(ball, Vec3::new(1.0, -0.9, -0.5), 0.4);
    m.done()
}

/// Walls, a table, and pots of large instanced plants.
fn room_of_plants() -> Scene {
    let mut m = Maker::new(16);
    m.room(Vec3::new(3.0, 1.5, 3.0));
    m.boxes(6, -1.5, 2.5, (0.3, 0.9));
    let plant = m.plant(8_000);
    for _ in 0..24 {
        let (x, z, size) = (m.between(-2.6, 2.6), m.between(-2.6, 1.0), m.between(0.6, 1.6));
        m.place(plant, Vec3::new(x, -1.5, z), size);
    }
    m.done()
}

/// Instances of four trees on a plain.
fn forest() -> Scene {
    let mut m = Maker::new(17);
    m.floor(60.0);
    let trees: Vec<MeshId> = (0..4).map(|_| m.plant(2_500)).collect();
    for i in 0..1_000 {
        let (x, z, size) = (m.between(-40.0, 40.0), m.between(-40.0, 40.0), m.between(2.0, 5.0));
        m.place(trees[i % 4], Vec3::new(x, 0.0, z), size);
    }
    m.sky();
    m.look(Vec3::new(0.0, 8.0, 48.0), Vec3::Y, 0.8);
    m.done()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Oracle: the table. The small ones are made; names are distinct.
    #[test]
    fn entries_say_how_large_they_are() {
        for entry in ALL.iter().filter(|entry| entry.about < 40_000) {
            let scene = (entry.make)();
            let ratio = scene.triangle_count() as f64 / entry.about as f64;
            assert!((0.8..1.25).contains(&ratio), "{}: {}", entry.name, scene.triangle_count());
            assert!(scene.has_light() && scene.cameras.len() == 1, "{}", entry.name);
        }
        let mut names = ALL.map(|entry| entry.name);
        names.sort_unstable();
        assert!(names.windows(2).all(|pair| pair[0] != pair[1]));
    }
}
