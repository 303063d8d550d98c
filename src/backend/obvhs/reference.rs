//! A stack entry or a child of a node, in 32 bits; the upper two say which stage of the traversal it is for.

/// A node, a block of triangles, or something rarer.
#[repr(transparent)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
pub(super) struct Reference(u32);

/// Set but for nodes.
const LEAF: u32 = 1 << 31;

/// Set besides [`LEAF`] for what is neither node nor triangles.
const RARE: u32 = 1 << 30;

/// The stages of the traversal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stage {
    /// A node's boxes.
    Boxes,
    /// Four triangles.
    Triangles,
    /// Everything else.
    Rare,
}

/// What a reference of [`Stage::Rare`] denotes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rare {
    /// The bottom of the stack.
    Done,
    /// An empty slot or hierarchy.
    Nothing,
    /// The way back from an instance.
    Leave,
    /// An instance, from outside.
    Instance(usize),
    /// Triangles of a mesh that changes its shape: the first of their blocks.
    Changing(usize),
}

/// Set in references of [`Rare::Changing`], not of [`Rare::Instance`].
const CHANGING: u32 = 1 << 29;

impl Reference {
    pub const DONE: Reference = Reference(u32::MAX);
    pub const NOTHING: Reference = Reference(u32::MAX - 1);
    pub const LEAVE: Reference = Reference(u32::MAX - 2);

    /// Things of a kind that 30 bits can number, and a few.
    const MOST: usize = (RARE - 4) as usize;

    /// The same of rare things, with one bit less.
    const MOST_RARE: usize = (CHANGING - 4) as usize;

    fn checked(index: usize) -> u32 {
        assert!(index < Self::MOST, "a hierarchy of 2^30 nodes or leaves");
        index as u32
    }

    /// The node at `index`.
    pub fn node(index: usize) -> Self {
        Reference(Self::checked(index))
    }

    /// The block of triangles at `index`.
    pub fn triangles(index: usize) -> Self {
        Reference(LEAF | Self::checked(index))
    }

    fn checked_rare(index: usize) -> u32 {
        assert!(index < Self::MOST_RARE, "2^29 instances, or leaves of meshes that change their shape");
        index as u32
    }

    /// The instance at `index`.
    pub fn instance(index: usize) -> Self {
        Reference(LEAF | RARE | Self::checked_rare(index))
    }

    /// Triangles of a mesh that changes its shape; the first of their blocks is at `index`.
    pub fn changing(index: usize) -> Self {
        Reference(LEAF | RARE | CHANGING | Self::checked_rare(index))
    }

    /// The same thing in arrays that have `nodes` nodes, `leaves` blocks of triangles, and `changing` blocks of meshes
    /// that change their shape before it.
    pub fn shifted(self, nodes: usize, leaves: usize, changing: usize) -> Self {
        match self.stage() {
            Stage::Boxes => Self::node(self.index() + nodes),
            Stage::Triangles => Self::triangles(self.index() + leaves),
            Stage::Rare => match self.rare() {
                Rare::Changing(index) => Self::changing(index + changing),
                _ => self,
            },
        }
    }

    /// What [`shifted`](Self::shifted) by as much makes this of.
    pub fn shifted_back(self, nodes: usize, leaves: usize, changing: usize) -> Self {
        match self.stage() {
            Stage::Boxes => Self::node(self.index() - nodes),
            Stage::Triangles => Self::triangles(self.index() - leaves),
            Stage::Rare => match self.rare() {
                Rare::Changing(index) => Self::changing(index - changing),
                _ => self,
            },
        }
    }

    /// Index of a node, a block of triangles or an instance.
    #[inline(always)]
    pub fn index(self) -> usize {
        (self.0 & !(LEAF | RARE)) as usize
    }

    /// Which stage it is for.
    #[inline(always)]
    pub fn stage(self) -> Stage {
        if self.0 & LEAF == 0 {
            Stage::Boxes
        } else if self.0 & RARE == 0 {
            Stage::Triangles
        } else {
            Stage::Rare
        }
    }

    /// The bits that say the stage: 0 or 1 for [`Stage::Boxes`], 2 for [`Stage::Triangles`], 3 for [`Stage::Rare`].
    #[inline(always)]
    pub fn stage_bits(self) -> usize {
        (self.0 >> 30) as usize
    }

    /// 1 for [`Stage::Boxes`], else 0; without a branch.
    #[inline(always)]
    pub fn is_boxes(self) -> usize {
        (self.0 >> 31 ^ 1) as usize
    }

    /// 1 for [`Stage::Rare`], else 0; without a branch.
    #[inline(always)]
    pub fn is_rare(self) -> usize {
        ((self.0 >> 31) & (self.0 >> 30)) as usize
    }

    /// What a reference of [`Stage::Rare`] denotes.
    pub fn rare(self) -> Rare {
        match self {
            Self::DONE => Rare::Done,
            Self::NOTHING => Rare::Nothing,
            Self::LEAVE => Rare::Leave,
            Reference(bits) if bits & CHANGING != 0 => Rare::Changing((bits & !(LEAF | RARE | CHANGING)) as usize),
            Reference(bits) => Rare::Instance((bits & !(LEAF | RARE)) as usize),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Oracle: what went in comes out, and the branch-free flags say what the stage says.
    #[test]
    fn references_keep_what_they_name() {
        for index in [0, 1, 77, Reference::MOST - 1] {
            assert_eq!(Reference::node(index).index(), index);
            assert_eq!(Reference::triangles(index).index(), index);
            let rare = index.min(Reference::MOST_RARE - 1);
            assert_eq!(Reference::instance(rare).rare(), Rare::Instance(rare));
            assert_eq!(Reference::changing(rare).rare(), Rare::Changing(rare));
        }
        let rare = [Reference::DONE, Reference::NOTHING, Reference::LEAVE, Reference::instance(3)];
        for reference in rare.into_iter().chain([Reference::node(5), Reference::triangles(5)]) {
            assert_eq!(reference.is_boxes() == 1, reference.stage() == Stage::Boxes);
            assert_eq!(reference.is_rare() == 1, reference.stage() == Stage::Rare);
            assert_eq!(reference.shifted(0, 0, 0), reference);
        }
        assert_eq!(Reference::node(5).shifted(10, 20, 30), Reference::node(15));
        assert_eq!(Reference::triangles(5).shifted(10, 20, 30), Reference::triangles(25));
        assert_eq!(Reference::changing(5).shifted(10, 20, 30), Reference::changing(35));
        assert_eq!(Reference::instance(5).shifted(10, 20, 30), Reference::instance(5));
        assert_eq!(Reference::DONE.rare(), Rare::Done);
    }
}
