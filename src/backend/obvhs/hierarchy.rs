//! Every mesh's nodes and triangles in one array each, and the hierarchy over the instances.

use glam::DVec3;
use rayon::prelude::*;

use super::collapse;
use super::leaf::Block;
use super::mesh::MeshTree;
use super::node::Node;
use super::reference::Reference;
use crate::backend::bounds::{self, Bounds};
use crate::math::simd::prefetch::fetch;
use crate::scene::geometry::{Geometry, Moving, Placement, TriangleMesh};

/// "Instance + 1" of what lies in the world.
pub(super) const INSTANCE_OF_WORLD: u32 = 0;

/// What the traversal reads.
#[derive(Debug)]
pub(super) struct Hierarchy {
    pub nodes: Vec<Node>,
    pub blocks: Vec<Block>,
    /// Blocks of meshes that change their shape.
    pub changing: Vec<Block>,
    /// By mesh, parts that the shutter is cut into for one that changes its shape.
    pub parts: Vec<usize>,
    /// The mesh that lies in the world; [`Reference::NOTHING`] if it is empty.
    pub world: Reference,
    /// The hierarchy over the instances.
    pub top: Reference,
    /// The meshes.
    pub roots: Vec<Reference>,
    pub instances: Vec<Placement>,
    /// Where those that move are over the shutter.
    pub moving: Moving,
    /// Triangles that are kept.
    pub triangles: u64,
}

impl Hierarchy {
    /// Builds one hierarchy per mesh, on the threads of the current pool, and one over the instances. `world` replaces
    /// the geometry's world mesh. `copies` says whether exact copies of triangles are kept.
    pub fn build(geometry: &Geometry, world: &TriangleMesh, copies: bool) -> Self {
        let scene = Bounds { lo: geometry.bounds.0, hi: geometry.bounds.1 };
        // Only the world mesh lies in the scene's space; the others know no extent but their own.
        let diagonal = |mesh: usize| if mesh == 0 { scene.diagonal() } else { 0.0 };
        let meshes: Vec<MeshTree> = (geometry.meshes.par_iter().enumerate())
            .map(|(i, mesh)| MeshTree::build(if i == 0 { world } else { mesh }, diagonal(i), copies))
            .collect();
        let bounds: Vec<Bounds> = meshes.iter().map(|mesh| mesh.bounds).collect();
        let (nodes, top) = over_instances(geometry, &bounds, bounds::reach_of(scene));

        let mut all = Hierarchy {
            nodes: Vec::new(),
            blocks: Vec::new(),
            changing: Vec::new(),
            parts: meshes.iter().map(|mesh| mesh.parts).collect(),
            world: Reference::NOTHING,
            top: Reference::NOTHING,
            roots: Vec::with_capacity(meshes.len()),
            instances: geometry.instances.clone(),
            moving: geometry.moving.clone(),
            triangles: meshes.iter().map(|mesh| mesh.triangles).sum(),
        };
        for mesh in meshes {
            let root = all.append(mesh.nodes, mesh.blocks, mesh.root);
            all.changing.extend(mesh.changing);
            all.roots.push(root);
        }
        all.top = all.append(nodes, Vec::new(), top);
        all.world = all.roots.first().copied().unwrap_or(Reference::NOTHING);
        all
    }

    /// Adds nodes and blocks that refer to one another, before the blocks of those that change their shape; the root as
    /// it is called here.
    fn append(&mut self, mut nodes: Vec<Node>, blocks: Vec<Block>, root: Reference) -> Reference {
        if self.nodes.is_empty() && self.blocks.is_empty() && self.changing.is_empty() {
            // The first, often the only one, stays where it is.
            (self.nodes, self.blocks) = (nodes, blocks);
            return root;
        }
        let (before, blocks_before, changing) = (self.nodes.len(), self.blocks.len(), self.changing.len());
        for node in &mut nodes {
            node.children = node.children.map(|child| child.shifted(before, blocks_before, changing));
        }
        self.nodes.append(&mut nodes);
        self.blocks.extend(blocks);
        root.shifted(before, blocks_before, changing)
    }

    /// Mesh of an instance, by its number + 1; 0 is the world.
    #[inline(always)]
    pub fn mesh_of(&self, instance: u32) -> u32 {
        if instance == INSTANCE_OF_WORLD { 0 } else { self.instances[instance as usize - 1].mesh }
    }

    /// Where the things lie that references of each stage name.
    pub fn places(&self) -> Places {
        let nodes = (self.nodes.as_ptr().cast(), size_of::<Node>());
        let blocks = (self.blocks.as_ptr().cast(), size_of::<Block>());
        // For what is rare some place that is there: an address out of the way takes the longest to look up.
        Places([nodes, nodes, blocks, (nodes.0, 0)])
    }

    /// Bytes of nodes and blocks.
    pub fn bytes(&self) -> u64 {
        let blocks = size_of_val(self.blocks.as_slice()) + size_of_val(self.changing.as_slice());
        (size_of_val(self.nodes.as_slice()) + blocks) as u64
    }
}

/// First address and size of the things of a stage, by [`Reference::stage_bits`].
pub(super) struct Places([(*const u8, usize); 4]);

impl Places {
    /// Asks for the memory of what is visited next: three cache lines, which hold a block; a node needs two, but a
    /// branch would cost more than the third.
    #[inline(always)]
    pub fn fetch(&self, what: Reference) {
        let (first, size) = self.0[what.stage_bits() & 3];
        fetch::<3>(first.wrapping_add(what.index() * size));
    }
}

/// The nodes over the instances, whose references name instances, and their root.
fn over_instances(geometry: &Geometry, meshes: &[Bounds], reach: DVec3) -> (Vec<Node>, Reference) {
    // Instances of empty meshes cannot be hit and would have no box.
    let (mut placed, mut boxes) = (Vec::new(), Vec::new());
    for (i, placement) in geometry.instances.iter().enumerate() {
        let Some(&mesh) = meshes.get(placement.mesh as usize).filter(|mesh| !mesh.is_empty()) else { continue };
        placed.push(i);
        boxes.push(bounds::of_instance(geometry, i, mesh, reach));
    }
    let reference = |(): &mut (), item: &[u32]| Reference::instance(placed[item[0] as usize]);
    let (nodes, (), root) = collapse::build(&boxes, 1, || (), reference);
    (nodes, root)
}
