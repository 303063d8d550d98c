//! The walk: thirty-two rays are under way at a time, and each round takes every one of them a step further. Rays wait in a queue
//! for each stage (a node's boxes, four triangles, the rare rest), so that a step is a loop body without branches to guess, and
//! memory that a ray needs next is asked for a round before.
//!
//! Rays that are done give their place to the next of the batch. What a ray hits depends on neither its neighbours nor the order of
//! its steps: the closest hit is the least (distance, instance, mesh, triangle) of all.

use std::cell::Cell;

use super::INSTANCE_OF_WORLD;
use super::hierarchy::{Hierarchy, Places};
use super::isa::Isa;
use super::leaf::Sheared;
use super::node::SLACK;
use super::ray::Record;
use super::reference::{Rare, Reference};
use super::stack::Stack;
use crate::backend::batch::{BLOCKED, LANES, RayBlock, RayHitBlock, valid_lanes};
use crate::backend::triangle::{Closest, Ray, TriangleHit};

/// Rays under way. 16 leave memory latency and the ends of the loops to be seen (4 % slower), 48 do not stay in the first cache
/// (10 % slower).
const RAYS: usize = 32;

/// Room of a queue: a place behind the last is written before it is known whether it is kept.
const ROOM: usize = 2 * RAYS;

/// What is asked of the rays of a batch.
pub(super) trait Goal {
    /// Sixteen of its rays.
    type Block;

    /// Whether any hit will do.
    const ANY: bool;

    /// The rays of a block, before they are traced.
    fn begin(block: &mut Self::Block) -> &RayBlock;

    /// The rays of a block.
    fn rays(block: &Self::Block) -> &RayBlock;

    /// Writes what a ray has met.
    fn finish(block: &mut Self::Block, lane: usize, closest: &Closest);
}

/// The closest hit.
pub(super) struct Nearest;

/// Whether the segment is blocked.
pub(super) struct Blocked;

impl Goal for Nearest {
    type Block = RayHitBlock;
    const ANY: bool = false;

    #[inline(always)]
    fn begin(block: &mut RayHitBlock) -> &RayBlock {
        block.clear_hits();
        &block.ray
    }

    #[inline(always)]
    fn rays(block: &RayHitBlock) -> &RayBlock {
        &block.ray
    }

    #[inline(always)]
    fn finish(block: &mut RayHitBlock, lane: usize, closest: &Closest) {
        closest.store(block, lane);
    }
}

impl Goal for Blocked {
    type Block = RayBlock;
    const ANY: bool = true;

    #[inline(always)]
    fn begin(block: &mut RayBlock) -> &RayBlock {
        block
    }

    #[inline(always)]
    fn rays(block: &RayBlock) -> &RayBlock {
        block
    }

    #[inline(always)]
    fn finish(block: &mut RayBlock, lane: usize, closest: &Closest) {
        if closest.is_hit() {
            block.tfar[lane] = BLOCKED;
        }
    }
}

/// A ray under way.
#[repr(C, align(64))]
struct Flight {
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

/// The memory of a walk.
struct Memory {
    flights: [Flight; RAYS],
    sheared: [Sheared; RAYS],
    candidates: [Candidate; CANDIDATES],
}

impl Memory {
    #[cold]
    #[inline(never)]
    fn new() -> Box<Self> {
        Box::new(Memory {
            flights: [const { Flight::IDLE }; RAYS],
            sheared: [Sheared::EMPTY; RAYS],
            candidates: [(0, 0, 0); CANDIDATES],
        })
    }
}

thread_local! {
    /// One a thread, lent to the call: a batch begins without clearing it.
    static MEMORY: Cell<Option<Box<Memory>>> = const { Cell::new(None) };
}

/// The rays of a batch that are not yet under way.
struct Waiting<'b, G: Goal> {
    blocks: &'b mut [G::Block],
    len: usize,
    /// The next block.
    block: usize,
    /// Rays of the block before it that are still to start, prepared.
    valid: u16,
    records: [Record; LANES],
    invalid: u64,
}

impl<G: Goal> Waiting<'_, G> {
    /// Number of the next valid ray; its record is that of its lane until the next call.
    #[inline(always)]
    fn next(&mut self) -> Option<u32> {
        while self.valid == 0 {
            let first = self.block * LANES;
            if first >= self.len {
                return None;
            }
            let lanes = (self.len - first).min(LANES);
            let rays = G::begin(&mut self.blocks[self.block]);
            self.valid = valid_lanes(rays, lanes);
            self.invalid += u64::from(lanes as u32 - self.valid.count_ones());
            Record::of_block(rays, &mut self.records);
            self.block += 1;
        }
        let lane = self.valid.trailing_zeros() as usize % LANES;
        self.valid &= self.valid - 1;
        Some(((self.block - 1) * LANES + lane) as u32)
    }

    /// The shutter time of that ray.
    fn time(&self, number: u32) -> f32 {
        G::rays(&self.blocks[number as usize / LANES]).time[number as usize % LANES]
    }

    /// The ray of that number as it was given.
    fn ray(&self, number: u32) -> Ray {
        Ray::of_lane(G::rays(&self.blocks[number as usize / LANES]), number as usize % LANES)
    }
}

/// Traces the first `len` rays of `blocks`; returns how many were invalid.
#[inline(always)]
pub(super) fn run<G: Goal, I: Isa>(hierarchy: &Hierarchy, blocks: &mut [G::Block], len: usize) -> u64 {
    let mut memory = MEMORY.take().unwrap_or_else(Memory::new);
    let records = [Record::EMPTY; LANES];
    let mut waiting = Waiting::<G> { blocks, len, block: 0, valid: 0, records, invalid: 0 };
    let places = hierarchy.places();
    let mut queues = Queues { places, boxes: Queue::EMPTY, triangles: Queue::EMPTY, rare: Queue::EMPTY };
    for place in 0..RAYS {
        let flight = &mut memory.flights[place];
        if flight.start(hierarchy, &mut waiting) {
            queues.add(place as u8, flight.next);
        }
    }
    while queues.boxes.len + queues.triangles.len + queues.rare.len > 0 {
        boxes::<I>(hierarchy, &mut memory.flights, &mut queues);
        triangles::<G>(hierarchy, &mut memory, &mut queues);
        rare(hierarchy, &mut memory, &mut queues, &mut waiting);
    }
    MEMORY.set(Some(memory));
    waiting.invalid
}

/// A node for each ray that waits for one.
#[inline(always)]
fn boxes<I: Isa>(hierarchy: &Hierarchy, flights: &mut [Flight; RAYS], queues: &mut Queues) {
    let waiting = queues.boxes.take();
    for place in waiting.iter() {
        let flight = &mut flights[usize::from(place) % RAYS];
        hierarchy.nodes[flight.next.index()].enter::<I>(&flight.record, flight.reach, &mut flight.stack);
        flight.next = flight.stack.pop(flight.reach);
        queues.add(place, flight.next);
    }
}

/// Four triangles for each ray that waits for them.
#[inline(always)]
fn triangles<G: Goal>(hierarchy: &Hierarchy, memory: &mut Memory, queues: &mut Queues) {
    let waiting = queues.triangles.take();
    let mut found = 0;
    for (k, place) in waiting.iter().enumerate() {
        let flight = &memory.flights[usize::from(place) % RAYS];
        let sheared = &mut memory.sheared[k % RAYS];
        let pierced = hierarchy.blocks[flight.next.index()].pierced(&flight.record, sheared);
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
        let flight = &mut memory.flights[usize::from(place) % RAYS];
        let block = &hierarchy.blocks[flight.next.index()];
        let hit = memory.sheared[usize::from(k) % RAYS].hit(usize::from(lane), flight.record.dz);
        flight.offer::<G>(hit, block.prim(usize::from(lane)));
    }
    for place in waiting.iter() {
        let flight = &mut memory.flights[usize::from(place) % RAYS];
        flight.next = flight.stack.pop_any(flight.reach);
        queues.add(place, flight.next);
    }
}

/// Ends, instances, and rays that take the place of those that are done.
#[inline(always)]
fn rare<G: Goal>(hierarchy: &Hierarchy, memory: &mut Memory, queues: &mut Queues, batch: &mut Waiting<G>) {
    let waiting = queues.rare.take();
    for place in waiting.iter() {
        let flight = &mut memory.flights[usize::from(place) % RAYS];
        if flight.next == Reference::DONE {
            flight.finish(hierarchy, batch);
            if !flight.start(hierarchy, batch) {
                continue;
            }
        } else {
            flight.turn(hierarchy, batch);
        }
        queues.add(place, flight.next);
    }
}

impl Flight {
    const IDLE: Flight = Flight {
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

    /// Takes the next ray of the batch, if there is one: the world first, so that it shortens the ray before any transform.
    #[inline(always)]
    fn start<G: Goal>(&mut self, hierarchy: &Hierarchy, batch: &mut Waiting<G>) -> bool {
        let Some(ray) = batch.next() else { return false };
        let record = &batch.records[ray as usize % LANES];
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
    fn offer<G: Goal>(&mut self, hit: TriangleHit, prim: u32) {
        use std::hint::select_unpredictable as select;
        let rank = u64::from(self.instance) << 32 | u64::from(prim);
        let closer = (hit.t < self.hit.t) | ((hit.t == self.hit.t) & (rank < self.rank));
        let take = (hit.t >= self.record.tnear) & closer;
        if G::ANY {
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
    fn finish<G: Goal>(&self, hierarchy: &Hierarchy, batch: &mut Waiting<G>) {
        if self.rank != NO_RANK {
            let instance = (self.rank >> 32) as u32;
            let rank = (instance, hierarchy.mesh_of(instance), self.rank as u32);
            let (block, lane) = (self.ray as usize / LANES, self.ray as usize % LANES);
            G::finish(&mut batch.blocks[block], lane, &Closest { hit: self.hit, rank });
        }
    }

    /// Into an instance, or out of it.
    #[inline(never)]
    fn turn<G: Goal>(&mut self, hierarchy: &Hierarchy, batch: &Waiting<G>) {
        match self.next.rare() {
            Rare::Done | Rare::Nothing => {}
            Rare::Leave => {
                self.record = self.world;
                self.instance = INSTANCE_OF_WORLD;
            }
            Rare::Instance(instance) => {
                let moved = hierarchy.moving.at(instance as u32, batch.time(self.ray));
                let placement = moved.as_ref().unwrap_or(&hierarchy.instances[instance]);
                if let Some(ray) = batch.ray(self.ray).to_object(placement) {
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
