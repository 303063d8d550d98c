//! Every mesh's nodes and triangles in one array each, and the hierarchy over the instances.

use glam::DVec3;
use rayon::prelude::*;

use super::collapse;
use super::leaf::Block;
use super::mesh::{self, MeshTree};
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
    /// What each hierarchy was built over, where other frames may have the same; else empty.
    sources: Vec<Source>,
}

/// A mesh, by its digest, and where its hierarchy lies.
#[derive(Debug)]
struct Source {
    digest: u64,
    /// As handed to [`MeshTree::build`].
    diagonal: f64,
    copies: bool,
    /// Of nodes, blocks, and blocks of changing meshes: the first, and how many.
    place: [(usize, usize); 3],
    root: Reference,
    bounds: Bounds,
    triangles: u64,
}

impl Hierarchy {
    /// Builds one hierarchy per mesh, on the threads of the current pool, and one over the instances. `world` replaces
    /// the geometry's world mesh. `copies` says whether exact copies of triangles are kept. Hierarchies of meshes that
    /// `kept`, of another frame, has as well are taken from there.
    ///
    /// What of the world other frames have elsewhere has a hierarchy of its own, and a node joins the two: the stack
    /// has room for that. Hits do not depend on how hierarchies are made.
    pub fn build(geometry: &Geometry, world: &TriangleMesh, copies: bool, kept: Option<Hierarchy>) -> Self {
        let scene = Bounds { lo: geometry.bounds.0, hi: geometry.bounds.1 };
        let parts = geometry.parts(world);
        // Rounded up where frames differ: what moves may change it a little.
        let extent = scene.diagonal();
        let extent = if geometry.frames.differ() && extent > 0.0 { extent.log2().ceil().exp2() } else { extent };
        // Only the world mesh lies in the scene's space; the others know no extent but their own.
        let diagonal = |mesh: usize| if mesh == 0 { extent } else { 0.0 };
        let still = parts.as_ref().map_or(world, |[still, _]| still);
        let mut meshes: Vec<MeshTree> = (geometry.meshes.par_iter().enumerate())
            .map(|(i, mesh)| {
                let (mesh, diagonal) = (if i == 0 { still } else { mesh }, diagonal(i));
                let same = kept.as_ref().and_then(|kept| kept.taken(i, mesh, diagonal, copies));
                same.unwrap_or_else(|| MeshTree::build(mesh, diagonal, copies))
            })
            .collect();
        let moved = parts.as_ref().map(|[_, moved]| MeshTree::build(moved, extent, copies));
        drop(kept);
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
            triangles: meshes.iter().chain(&moved).map(|mesh| mesh.triangles).sum(),
            sources: Vec::new(),
        };
        for (i, tree) in meshes.drain(..).enumerate() {
            let first = [all.nodes.len(), all.blocks.len(), all.changing.len()];
            let count = [tree.nodes.len(), tree.blocks.len(), tree.changing.len()];
            let root = all.append(tree.nodes, tree.blocks, tree.root);
            all.changing.extend(tree.changing);
            all.roots.push(root);
            if geometry.frames.differ() {
                let mesh = if i == 0 { still } else { &geometry.meshes[i] };
                all.sources.push(Source {
                    digest: mesh.digest(),
                    diagonal: diagonal(i),
                    copies,
                    place: std::array::from_fn(|kind| (first[kind], count[kind])),
                    root,
                    bounds: tree.bounds,
                    triangles: tree.triangles,
                });
            }
        }
        if let (Some(moved), Some(&still)) = (moved, bounds.first())
            && !moved.bounds.is_empty()
        {
            let (root, around) = (all.append(moved.nodes, moved.blocks, moved.root), moved.bounds);
            let both =
                [(still, all.roots[0]), (around, root)].map(|(bounds, root)| (mesh::grown(bounds, extent), root));
            all.nodes.push(Node::new(&both));
            all.roots[0] = Reference::node(all.nodes.len() - 1);
        }
        all.top = all.append(nodes, Vec::new(), top);
        all.world = all.roots.first().copied().unwrap_or(Reference::NOTHING);
        all
    }

    /// The hierarchy of mesh `index`, if it was built over this one.
    fn taken(&self, index: usize, mesh: &TriangleMesh, diagonal: f64, copies: bool) -> Option<MeshTree> {
        let source = self.sources.get(index)?;
        let is_same = (source.diagonal, source.copies) == (diagonal, copies) && source.digest == mesh.digest();
        let [nodes, blocks, changing] = source.place;
        let back = |what: Reference| what.shifted_back(nodes.0, blocks.0, changing.0);
        let of_its_own = |mut node: Node| {
            node.children = node.children.map(back);
            node
        };
        is_same.then(|| MeshTree {
            nodes: self.nodes[nodes.0..][..nodes.1].iter().copied().map(of_its_own).collect(),
            blocks: self.blocks[blocks.0..][..blocks.1].to_vec(),
            changing: self.changing[changing.0..][..changing.1].to_vec(),
            parts: self.parts[index],
            root: back(source.root),
            bounds: source.bounds,
            triangles: source.triangles,
        })
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
