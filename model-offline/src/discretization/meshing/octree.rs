//! Octrees in which neighbours, across faces, edges and corners alike, differ by at most one level.

/// The root spans this many units per side; a leaf at depth d spans `ROOT >> d`.
pub(super) const ROOT: i64 = 1 << DEPTH;
/// The finest leaves still have a centre on the grid of units.
const DEPTH: u32 = 20;

/// A cube in the tree, corners and side in units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Cube {
    /// Lowest corner.
    pub(super) low: [i64; 3],
    /// Side.
    pub(super) side: i64,
    /// First of its eight children, 0 for a leaf.
    children: usize,
}

impl Cube {
    /// Twice the centre would be odd for the finest leaves only: they are at least two units wide.
    pub(super) fn centre(&self) -> [i64; 3] {
        self.low.map(|x| x + self.side / 2)
    }

    /// Whether it has no children.
    pub(super) fn is_leaf(&self) -> bool {
        self.children == 0
    }
}

/// A cube that is split where needed.
#[derive(Debug)]
pub(super) struct Octree {
    cubes: Vec<Cube>,
}

impl Octree {
    /// Splits as `splits` asks, at most to leaves two units wide, and then for balance. Gives up with the number of
    /// leaves so far where `too_many` of it are reached.
    pub(super) fn new(splits: impl Fn(&Cube) -> bool, too_many: usize) -> Result<Self, usize> {
        let mut tree = Self { cubes: vec![Cube { low: [0; 3], side: ROOT, children: 0 }] };
        let mut at = 0;
        while at < tree.cubes.len() {
            if tree.cubes[at].side > 2 && splits(&tree.cubes[at]) {
                tree.split(at);
            }
            if tree.cubes.len() > too_many {
                return Err(tree.cubes.len());
            }
            at += 1;
        }
        tree.balance();
        Ok(tree)
    }

    /// All leaves.
    pub(super) fn leaves(&self) -> impl Iterator<Item = &Cube> {
        self.cubes.iter().filter(|c| c.is_leaf())
    }

    /// The leaf around a point that lies on no boundary between cubes; none outside the root.
    pub(super) fn find(&self, x: [i64; 3]) -> Option<&Cube> {
        self.locate(x).map(|at| &self.cubes[at])
    }

    fn locate(&self, x: [i64; 3]) -> Option<usize> {
        if x.iter().any(|x| *x < 0 || *x >= ROOT) {
            return None;
        }
        let mut at = 0;
        while !self.cubes[at].is_leaf() {
            let cube = &self.cubes[at];
            let half = cube.side / 2;
            let child = (0..3).fold(0, |child, k| child | usize::from(x[k] >= cube.low[k] + half) << k);
            at = cube.children + child;
        }
        Some(at)
    }

    fn split(&mut self, at: usize) {
        let Cube { low, side, .. } = self.cubes[at];
        self.cubes[at].children = self.cubes.len();
        for child in 0..8 {
            let low = [0, 1, 2].map(|k| low[k] + (child >> k & 1) * (side / 2));
            self.cubes.push(Cube { low, side: side / 2, children: 0 });
        }
    }

    fn balance(&mut self) {
        let mut queue: Vec<usize> = (0..self.cubes.len()).filter(|at| self.cubes[*at].is_leaf()).collect();
        while let Some(at) = queue.pop() {
            let cube = self.cubes[at];
            if !cube.is_leaf() {
                continue;
            }
            let centre = cube.centre();
            for direction in 0..27 {
                let beside = [direction % 3 - 1, direction / 3 % 3 - 1, direction / 9 - 1];
                let x = [0, 1, 2].map(|k| centre[k] + beside[k] * cube.side);
                while let Some(next) = self.locate(x).filter(|n| self.cubes[*n].side > 2 * cube.side) {
                    let first = self.cubes.len();
                    self.split(next);
                    queue.extend(first..first + 8);
                }
            }
        }
    }
}
