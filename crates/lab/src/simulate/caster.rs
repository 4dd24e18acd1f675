//! Finds what a ray hits first. Solids lie in the cells of a grid over the floor, which rays walk cell
//! by cell (Amanatides and Woo, *A Fast Voxel Traversal Algorithm for Ray Tracing*, 1987).

use super::plan::Rect;
use super::solid::Solid;
use super::vector::{Vec3, gray};

/// The side of a grid cell, in meters.
const CELL: f32 = 0.6;

/// By how much solids are taken for larger than they are when they are sorted out, in meters.
const ROUNDING: f32 = 1e-3;

/// The solids of a lab, by where they stand.
pub(super) struct Caster {
    solids: Vec<Solid>,
    /// The least x and y of the grid.
    corner: [f32; 2],
    /// Cells along x and y.
    n_cells: [usize; 2],
    /// Where the solids of each cell begin in `entries`, one more than there are cells.
    starts: Vec<u32>,
    entries: Vec<Entry>,
}

/// The first hit of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Hit {
    pub distance: f32,
    pub solid_idx: usize,
}

impl Caster {
    /// Sorts solids into a grid over `bounds`.
    pub fn new(solids: Vec<Solid>, bounds: Rect) -> Self {
        let corner = [bounds.x0 - CELL, bounds.y0 - CELL];
        let n_cells = bounds.size().map(|size| (size / CELL).ceil() as usize + 2);
        let mut cells = vec![Vec::new(); n_cells[0] * n_cells[1]];
        for (solid_idx, solid) in solids.iter().enumerate() {
            let [x0, y0, x1, y1] = solid.footprint();
            // A little more than the solid covers, so that rounding loses no hit on a cell's border.
            let range = |low: f32, high: f32, axis: usize| {
                let cell =
                    |at: f32| ((at - corner[axis]) / CELL).clamp(0.0, (n_cells[axis] - 1) as f32) as usize;
                cell(low - ROUNDING)..=cell(high + ROUNDING)
            };
            for row in range(y0, y1, 1) {
                for column in range(x0, x1, 0) {
                    cells[row * n_cells[0] + column].push(Entry::new(solid_idx, solid));
                }
            }
        }
        let mut starts = vec![0];
        let mut entries = Vec::new();
        for cell in cells {
            entries.extend(cell);
            starts.push(entries.len() as u32);
        }
        Self { solids, corner, n_cells, starts, entries }
    }

    pub fn solid(&self, solid_idx: usize) -> &Solid {
        &self.solids[solid_idx]
    }

    /// The nearest hit within `reach`.
    pub fn cast(&self, origin: Vec3, direction: Vec3, reach: f32) -> Option<Hit> {
        let beam = Beam::new(origin, direction);
        let mut nearest = Hit { distance: reach, solid_idx: usize::MAX };
        self.walk(&beam, |cell, range| {
            for solid_idx in beam.candidates(cell, range) {
                let distance = self.solids[solid_idx].entry(origin, direction);
                if distance < nearest.distance {
                    nearest = Hit { distance, solid_idx };
                }
            }
            nearest.distance <= range[1]
        });
        (nearest.solid_idx != usize::MAX).then_some(nearest)
    }

    /// Whether nothing lies between two points.
    pub fn is_clear(&self, from: Vec3, to: Vec3) -> bool {
        let way = to - from;
        let length = way.length();
        let direction = way * (1.0 / length);
        let beam = Beam::new(from, direction);
        let mut is_blocked = false;
        self.walk(&beam, |cell, range| {
            let blocks = |idx: usize| self.solids[idx].entry(from, direction) < length - 1e-3;
            is_blocked = beam.candidates(cell, range).any(blocks);
            is_blocked || range[1] >= length
        });
        !is_blocked
    }

    /// Calls `visit` with every cell along a ray and the distances at which the ray enters and leaves it,
    /// until `visit` says that it has seen enough or the grid ends.
    #[inline]
    fn walk(&self, beam: &Beam, mut visit: impl FnMut(&[Entry], [f32; 2]) -> bool) {
        let axis = |at: f32, slope: f32, idx: usize| {
            let place = (at - self.corner[idx]) / CELL;
            let cell = place as isize;
            let per_cell = CELL / slope.abs().max(1e-9);
            let share = if slope > 0.0 { (cell + 1) as f32 - place } else { place - cell as f32 };
            (cell, if slope > 0.0 { 1 } else { -1 }, share * per_cell, per_cell)
        };
        let Beam { origin, direction, .. } = *beam;
        let (mut column, step_x, mut next_x, per_column) = axis(origin.x, direction.x, 0);
        let (mut row, step_y, mut next_y, per_row) = axis(origin.y, direction.y, 1);
        let [n_columns, n_rows] = self.n_cells.map(|n| n as isize);
        let mut from = 0.0;
        while (0..n_columns).contains(&column) && (0..n_rows).contains(&row) {
            let cell_idx = (row * n_columns + column) as usize;
            let cell = &self.entries[self.starts[cell_idx] as usize..self.starts[cell_idx + 1] as usize];
            let to = if next_x < next_y { next_x } else { next_y };
            if visit(cell, [from, to]) {
                return;
            }
            from = to;
            if next_x < next_y {
                column += step_x;
                next_x += per_column;
            } else {
                row += step_y;
                next_y += per_row;
            }
        }
    }
}

/// A solid in a cell, with what it takes to pass over most of them quickly.
#[derive(Clone, Copy)]
struct Entry {
    solid_idx: u32,
    bottom: f32,
    top: f32,
    /// Where its axis stands, and how far it reaches from there, squared.
    axis: [f32; 2],
    squared_reach: f32,
}

impl Entry {
    fn new(solid_idx: usize, solid: &Solid) -> Self {
        let half = solid.half + gray(ROUNDING);
        Self {
            solid_idx: solid_idx as u32,
            bottom: solid.center.z - half.z,
            top: solid.center.z + half.z,
            axis: [solid.center.x, solid.center.y],
            squared_reach: half.x * half.x + half.y * half.y,
        }
    }
}

/// A ray, prepared for passing over solids.
struct Beam {
    origin: Vec3,
    direction: Vec3,
    /// The squared length of the direction's shadow on the floor.
    squared_shadow: f32,
}

impl Beam {
    fn new(origin: Vec3, direction: Vec3) -> Self {
        let squared_shadow = direction.x * direction.x + direction.y * direction.y;
        Self { origin, direction, squared_shadow }
    }

    /// The solids of a cell that the ray may meet between the distances at which it enters and leaves.
    #[inline]
    fn candidates<'a>(&'a self, cell: &'a [Entry], range: [f32; 2]) -> impl Iterator<Item = usize> + 'a {
        let heights = range.map(|distance| self.origin.z + distance * self.direction.z);
        let may_meet = move |entry: &&Entry| self.may_meet(entry, heights);
        cell.iter().filter(may_meet).map(|entry| entry.solid_idx as usize)
    }

    #[inline]
    fn may_meet(&self, entry: &Entry, [from, to]: [f32; 2]) -> bool {
        let is_above = entry.bottom > from && entry.bottom > to;
        let is_below = entry.top < from && entry.top < to;
        if is_above || is_below {
            return false;
        }
        let [x, y] = [entry.axis[0] - self.origin.x, entry.axis[1] - self.origin.y];
        let aside = x * self.direction.y - y * self.direction.x;
        aside * aside <= entry.squared_reach * self.squared_shadow
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::solid::{Mapping, Material, Shape};
    use crate::simulate::texture::{Palette, Pattern};
    use crate::simulate::vector::vec3;
    use proptest::prelude::*;

    fn pillar(x: f32, y: f32, size: [f32; 3]) -> Solid {
        let texture = Palette::default().texture(Pattern::Paint, 0);
        let material = Material { texture, tint: gray(1.0), mapping: Mapping::Fitted, glow: 0.0 };
        let half = vec3(size[0], size[1], size[2]);
        let turn = [x.cos(), x.sin()];
        Solid { shape: Shape::Box, center: vec3(x, y, 1.0), half, turn, front: material, rest: material }
    }

    proptest! {
        #[test]
        fn the_grid_finds_what_trying_every_solid_finds(
            places in prop::collection::vec((0.5_f32..9.5, 0.5_f32..5.5, prop::array::uniform3(0.05_f32..0.9)), 1..30),
            origin in (0.1_f32..9.9, 0.1_f32..5.9, 0.1_f32..2.5),
            target in (-5.0_f32..15.0, -5.0_f32..10.0, -1.0_f32..3.0),
        ) {
            let solids: Vec<Solid> = places.iter().map(|&(x, y, size)| pillar(x, y, size)).collect();
            let origin = vec3(origin.0, origin.1, origin.2);
            let target = vec3(target.0, target.1, target.2);
            let direction = (target - origin).normalized();
            let entries = solids.iter().map(|solid| solid.entry(origin, direction));
            let naive = entries.fold(f32::INFINITY, f32::min);
            let bounds = Rect { x0: -2.0, y0: -2.0, x1: 12.0, y1: 8.0 };
            let caster = Caster::new(solids, bounds);
            let found = caster.cast(origin, direction, 100.0).map_or(f32::INFINITY, |hit| hit.distance);
            prop_assert_eq!(found, naive);
            let is_clear = naive >= (target - origin).length() - 1e-3;
            prop_assert_eq!(caster.is_clear(origin, target), is_clear);
        }
    }
}
