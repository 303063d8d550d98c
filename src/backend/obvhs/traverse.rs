//! Stream traversal: thirty-two rays are in flight at a time, and each round takes every one of them a step further.
//! Rays wait in a queue for each stage (a node's boxes, four triangles, the rare rest), so that a step is a loop body
//! without branches to predict, and what a ray needs next is prefetched a round ahead.
//!
//! Rays that are done give their place to the next of the batch. What a ray hits depends on neither its neighbours nor
//! the order of its steps: the closest hit is the least (distance, instance, mesh, triangle) of all.

use std::cell::Cell;

use super::hierarchy::{Hierarchy, INSTANCE_OF_WORLD, Places};
use super::leaf::{Block, Sheared};
use super::node::SLACK;
use super::ray::Record;
use super::reference::{Rare, Reference};
use super::stack::Stack;
use crate::backend::batch::{Batch, LANES};
use crate::backend::past::{Without, key_of};
use crate::backend::triangle::{Closest, Ray, RayByRay, TriangleHit};
use crate::math::simd::isa::{Isa, Kernel};
use crate::scene::motion::part_of;

/// Rays in flight. 16 leave memory latency and the ends of the loops to be seen (4 % slower), 48 do not stay in the
/// first cache (10 % slower).
const RAYS: usize = 32;

/// Room of a queue: a place behind the last is written before it is known whether it is kept.
const ROOM: usize = 2 * RAYS;

/// A ray in flight.
#[repr(C, align(64))]
struct ActiveRay {
    /// In the space of what it is in: the world or an instance.
    record: Record,
    /// In the world, while it is in an instance.
    world: Record,
    /// What it visits next.
    next: Reference,
    /// How far it may still go, with the boxes' slack.
    reach: f32,
    hit: TriangleHit,
    /// Rank of the hit: instance + 1 above the triangle.
    rank: u64,
    /// Instance + 1, or 0.
    instance: u32,
    /// Ray of the batch.
    ray: u32,
    stack: Stack,
}

/// Loses every tie, so that a hit at exactly `tfar` counts.
const NO_RANK: u64 = u64::MAX;

/// Rays that wait for a stage.
#[derive(Clone, Copy)]
struct Queue {
    rays: [u8; ROOM],
    len: usize,
}

impl Queue {
    const EMPTY: Queue = Queue { rays: [0; ROOM], len: 0 };

    /// Adds `ray` if `count` is 1, not if it is 0.
    #[inline(always)]
    fn add(&mut self, ray: u8, count: usize) {
        self.rays[self.len % ROOM] = ray;
        self.len += count;
    }

    /// Empties the queue; what it held.
    #[inline(always)]
    fn take(&mut self) -> Queue {
        std::mem::replace(self, Queue::EMPTY)
    }

    /// The rays in it.
    #[inline(always)]
    fn iter(&self) -> impl Iterator<Item = u8> {
        self.rays[..self.len.min(ROOM)].iter().copied()
    }
}

/// The queues of the stages.
struct Queues {
    places: Places,
    boxes: Queue,
    triangles: Queue,
    rare: Queue,
}

impl Queues {
    /// Puts `ray` where `next` is done, and asks for its memory.
    #[inline(always)]
    fn add(&mut self, ray: u8, next: Reference) {
        let (boxes, rare) = (next.is_boxes(), next.is_rare());
        self.boxes.add(ray, boxes);
        self.triangles.add(ray, 1 - boxes - rare);
        self.rare.add(ray, rare);
        self.places.fetch(next);
    }
}

/// A triangle that a ray's line pierces: the ray, the place of its sheared corners, the lane.
type Candidate = (u8, u8, u8);

/// All four triangles of all rays, and the place behind them.
const CANDIDATES: usize = 8 * RAYS;

/// The memory of a traversal.
struct Memory {
    rays: [ActiveRay; RAYS],
    sheared: [Sheared; RAYS],
    candidates: [Candidate; CANDIDATES],
}

impl Memory {
    #[cold]
    #[inline(never)]
    fn new() -> Box<Self> {
        Box::new(Memory {
            rays: [const { ActiveRay::IDLE }; RAYS],
            sheared: [Sheared::EMPTY; RAYS],
            candidates: [(0, 0, 0); CANDIDATES],
        })
    }
}

thread_local! {
    /// One a thread, lent to the call: a batch begins without clearing it.
    static MEMORY: Cell<Option<Box<Memory>>> = const { Cell::new(None) };
}

/// The rays of a batch that have not started.
struct Waiting<'b, B> {
    batch: Batch<'b, B>,
    /// Number of the first ray of the current block.
    first: usize,
    /// Rays of that block that are still to start, prepared.
    valid: u16,
    records: [Record; LANES],
}

impl<B: RayByRay> Waiting<'_, B> {
    /// Number of the next valid ray; its record is that of its lane until the next call.
    #[inline(always)]
    fn next(&mut self) -> Option<u32> {
        while self.valid == 0 {
            let (index, block, valid) = self.batch.next_block()?;
            Record::of_block(block.rays(), &mut self.records);
            (self.first, self.valid) = (index * LANES, valid);
        }
        let lane = self.valid.trailing_zeros() as usize % LANES;
        self.valid &= self.valid - 1;
        Some((self.first + lane) as u32)
    }

    /// The shutter time of that ray.
    fn time(&self, number: u32) -> f32 {
        self.batch.blocks[number as usize / LANES].rays().time[number as usize % LANES]
    }

    /// The ray of that number as it was given.
    fn ray(&self, number: u32) -> Ray {
        Ray::of_lane(self.batch.blocks[number as usize / LANES].rays(), number as usize % LANES)
    }
}

/// Traces a batch without the triangles that its rays have passed; the number of invalid rays.
pub(super) struct Traverse<'a, B, W> {
    pub hierarchy: &'a Hierarchy,
    pub batch: Batch<'a, B>,
    pub without: W,
}

impl<B: RayByRay, W: Without> Kernel for Traverse<'_, B, W> {
    type Output = u64;

    #[inline(always)]
    fn run<I: Isa>(self) -> u64 {
        let Traverse { hierarchy, batch, without } = self;
        let mut memory = MEMORY.take().unwrap_or_else(Memory::new);
        let mut waiting = Waiting { batch, first: 0, valid: 0, records: [Record::EMPTY; LANES] };
        let places = hierarchy.places();
        let mut queues = Queues { places, boxes: Queue::EMPTY, triangles: Queue::EMPTY, rare: Queue::EMPTY };
        for place in 0..RAYS {
            let ray = &mut memory.rays[place];
            if ray.start(hierarchy, &mut waiting) {
                queues.add(place as u8, ray.next);
            }
        }
        while queues.boxes.len + queues.triangles.len + queues.rare.len > 0 {
            boxes::<I>(hierarchy, &mut memory.rays, &mut queues);
            triangles::<B>(hierarchy, &mut memory, &mut queues, without);
            rare(hierarchy, &mut memory, &mut queues, &mut waiting, without);
        }
        MEMORY.set(Some(memory));
        waiting.batch.invalid()
    }
}

/// A node for each ray that waits for one.
#[inline(always)]
fn boxes<I: Isa>(hierarchy: &Hierarchy, rays: &mut [ActiveRay; RAYS], queues: &mut Queues) {
    let waiting = queues.boxes.take();
    for place in waiting.iter() {
        let ray = &mut rays[usize::from(place) % RAYS];
        hierarchy.nodes[ray.next.index()].enter::<I>(&ray.record, ray.reach, &mut ray.stack);
        ray.next = ray.stack.pop(ray.reach);
        queues.add(place, ray.next);
    }
}

/// Four triangles for each ray that waits for them.
#[inline(always)]
fn triangles<B: RayByRay>(hierarchy: &Hierarchy, memory: &mut Memory, queues: &mut Queues, without: impl Without) {
    let waiting = queues.triangles.take();
    let mut found = 0;
    for (k, place) in waiting.iter().enumerate() {
        let ray = &memory.rays[usize::from(place) % RAYS];
        let sheared = &mut memory.sheared[k % RAYS];
        let pierced = hierarchy.blocks[ray.next.index()].pierced(&ray.record, sheared);
        memory.candidates[found % CANDIDATES] = (place, k as u8, pierced.trailing_zeros() as u8);
        found += usize::from(pierced != 0);
        // Seldom more than one.
        let mut more = pierced & pierced.wrapping_sub(1);
        while more != 0 {
            memory.candidates[found % CANDIDATES] = (place, k as u8, more.trailing_zeros() as u8);
            found += 1;
            more &= more - 1;
        }
    }
    for &(place, k, lane) in &memory.candidates[..found.min(CANDIDATES)] {
        let ray = &mut memory.rays[usize::from(place) % RAYS];
        let block = &hierarchy.blocks[ray.next.index()];
        let hit = memory.sheared[usize::from(k) % RAYS].hit(usize::from(lane), ray.record.dz);
        let rank = key_of(ray.instance, block.prim(usize::from(lane)));
        if !without.is_passed(ray.ray as usize, rank) {
            ray.offer::<B>(hit, rank);
        }
    }
    for place in waiting.iter() {
        let ray = &mut memory.rays[usize::from(place) % RAYS];
        ray.next = ray.stack.pop_any(ray.reach);
        queues.add(place, ray.next);
    }
}

/// Ends, instances, and rays that take the place of those that are done.
#[inline(always)]
fn rare<B: RayByRay>(
    hierarchy: &Hierarchy,
    memory: &mut Memory,
    queues: &mut Queues,
    waiting: &mut Waiting<B>,
    without: impl Without,
) {
    let ready = queues.rare.take();
    for place in ready.iter() {
        let ray = &mut memory.rays[usize::from(place) % RAYS];
        if ray.next == Reference::DONE {
            ray.finish(hierarchy, waiting);
            if !ray.start(hierarchy, waiting) {
                continue;
            }
        } else {
            ray.turn(hierarchy, waiting, without);
        }
        queues.add(place, ray.next);
    }
}

impl ActiveRay {
    const IDLE: ActiveRay = ActiveRay {
        record: Record::EMPTY,
        world: Record::EMPTY,
        next: Reference::DONE,
        reach: 0.0,
        hit: TriangleHit { t: 0.0, u: 0.0, v: 0.0 },
        rank: NO_RANK,
        instance: INSTANCE_OF_WORLD,
        ray: 0,
        stack: Stack::EMPTY,
    };

    /// Takes the next ray of the batch, if there is one: the world first, so that it shortens the ray before any
    /// transform.
    #[inline(always)]
    fn start<B: RayByRay>(&mut self, hierarchy: &Hierarchy, waiting: &mut Waiting<B>) -> bool {
        let Some(ray) = waiting.next() else { return false };
        let record = &waiting.records[ray as usize % LANES];
        self.record = *record;
        self.instance = INSTANCE_OF_WORLD;
        self.ray = ray;
        self.stack.clear();
        self.reach = record.tfar * SLACK;
        self.hit = TriangleHit { t: record.tfar, u: 0.0, v: 0.0 };
        self.rank = NO_RANK;
        self.next = hierarchy.world;
        if hierarchy.top != Reference::NOTHING {
            self.stack.push_always(hierarchy.top);
        }
        true
    }

    /// Keeps the closer of two hits, or the lower at equal distance; without a branch, for each is as likely.
    #[inline(always)]
    fn offer<B: RayByRay>(&mut self, hit: TriangleHit, rank: u64) {
        use std::hint::select_unpredictable as select;
        let closer = (hit.t < self.hit.t) | ((hit.t == self.hit.t) & (rank < self.rank));
        let take = (hit.t >= self.record.tnear) & closer;
        if B::ANY {
            if take {
                self.rank = rank;
                self.stack.clear();
            }
            return;
        }
        self.hit = TriangleHit {
            t: select(take, hit.t, self.hit.t),
            u: select(take, hit.u, self.hit.u),
            v: select(take, hit.v, self.hit.v),
        };
        self.rank = select(take, rank, self.rank);
        self.reach = self.hit.t * SLACK;
    }

    /// Writes what the ray has met.
    #[inline(always)]
    fn finish<B: RayByRay>(&self, hierarchy: &Hierarchy, waiting: &mut Waiting<B>) {
        if self.rank != NO_RANK {
            let instance = (self.rank >> 32) as u32;
            let rank = (instance, hierarchy.mesh_of(instance), self.rank as u32);
            let (block, lane) = (self.ray as usize / LANES, self.ray as usize % LANES);
            waiting.batch.blocks[block].store(lane, &Closest { hit: self.hit, rank });
        }
    }

    /// Up to four triangles of a mesh that changes its shape, where they are at the time of the ray.
    #[cold]
    #[inline(never)]
    fn meet_changing<B: RayByRay>(&mut self, hierarchy: &Hierarchy, first: usize, time: f32, without: impl Without) {
        let parts = hierarchy.parts[hierarchy.mesh_of(self.instance) as usize];
        let (part, fraction) = part_of(time, parts);
        let block = Block::between(&hierarchy.changing[first + part], &hierarchy.changing[first + part + 1], fraction);
        let mut sheared = Sheared::EMPTY;
        let mut pierced = block.pierced(&self.record, &mut sheared);
        while pierced != 0 {
            let lane = pierced.trailing_zeros() as usize;
            pierced &= pierced - 1;
            let rank = key_of(self.instance, block.prim(lane));
            if !without.is_passed(self.ray as usize, rank) {
                self.offer::<B>(sheared.hit(lane, self.record.dz), rank);
            }
        }
    }

    /// Into an instance, or out of it; triangles that change their shape.
    #[inline(never)]
    fn turn<B: RayByRay>(&mut self, hierarchy: &Hierarchy, waiting: &Waiting<B>, without: impl Without) {
        match self.next.rare() {
            Rare::Done | Rare::Nothing => {}
            Rare::Changing(first) => {
                self.meet_changing::<B>(hierarchy, first, waiting.time(self.ray), without);
            }
            Rare::Leave => {
                self.record = self.world;
                self.instance = INSTANCE_OF_WORLD;
            }
            Rare::Instance(instance) => {
                let moved = hierarchy.moving.at(instance as u32, waiting.time(self.ray));
                let placement = moved.as_ref().unwrap_or(&hierarchy.instances[instance]);
                if let Some(ray) = waiting.ray(self.ray).to_object(placement) {
                    self.world = self.record;
                    self.record = Record::of(&ray);
                    self.instance = instance as u32 + 1;
                    self.stack.push_always(Reference::LEAVE);
                    self.stack.push_always(hierarchy.roots[placement.mesh as usize]);
                }
            }
        }
        self.next = self.stack.pop(self.reach);
    }
}
