//! Finds what a ray hits first. Solids lie in the cells of a grid over the floor, which rays walk cell
//! by cell (Amanatides and Woo, *A Fast Voxel Traversal Algorithm for Ray Tracing*, 1987).

use super::plan::Rect;
use super::solid::Solid;
use super::vector::Vec3;

/// The side of a grid cell, in meters.
const CELL: f32 = 0.4;

/// The solids of a lab, by where they stand.
pub(super) struct Caster {
    solids: Vec<Solid>,
    /// The least x and y of the grid.
    corner: [f32; 2],
    /// Cells along x and y.
    n_cells: [usize; 2],
    /// Where the solids of each cell begin in `entries`, one more than there are cells.
    starts: Vec<u32>,
    entries: Vec<u32>,
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
                cell(low - 1e-3)..=cell(high + 1e-3)
            };
            for row in range(y0, y1, 1) {
                for column in range(x0, x1, 0) {
                    cells[row * n_cells[0] + column].push(solid_idx as u32);
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
        let mut nearest = Hit { distance: reach, solid_idx: usize::MAX };
        self.walk(origin, direction, |cell, until| {
            for &solid_idx in cell {
                let distance = self.solids[solid_idx as usize].entry(origin, direction);
                if distance < nearest.distance {
                    nearest = Hit { distance, solid_idx: solid_idx as usize };
                }
            }
            nearest.distance <= until
        });
        (nearest.solid_idx != usize::MAX).then_some(nearest)
    }

    /// Whether nothing lies between two points.
    pub fn is_clear(&self, from: Vec3, to: Vec3) -> bool {
        let way = to - from;
        let length = way.length();
        let direction = way * (1.0 / length);
        let mut is_blocked = false;
        self.walk(from, direction, |cell, until| {
            let blocks = |&idx: &u32| self.solids[idx as usize].entry(from, direction) < length - 1e-3;
            is_blocked = cell.iter().any(blocks);
            is_blocked || until >= length
        });
        !is_blocked
    }

    /// Calls `visit` with the solids of every cell along a ray and the distance at which the ray leaves
    /// it, until `visit` says that it has seen enough or the grid ends.
    #[inline]
    fn walk(&self, origin: Vec3, direction: Vec3, mut visit: impl FnMut(&[u32], f32) -> bool) {
        let axis = |at: f32, slope: f32, idx: usize| {
            let place = (at - self.corner[idx]) / CELL;
            let cell = place as isize;
            let per_cell = CELL / slope.abs().max(1e-9);
            let share = if slope > 0.0 { (cell + 1) as f32 - place } else { place - cell as f32 };
            (cell, if slope > 0.0 { 1 } else { -1 }, share * per_cell, per_cell)
        };
        let (mut column, step_x, mut next_x, per_column) = axis(origin.x, direction.x, 0);
        let (mut row, step_y, mut next_y, per_row) = axis(origin.y, direction.y, 1);
        let [n_columns, n_rows] = self.n_cells.map(|n| n as isize);
        while (0..n_columns).contains(&column) && (0..n_rows).contains(&row) {
            let cell_idx = (row * n_columns + column) as usize;
            let cell = &self.entries[self.starts[cell_idx] as usize..self.starts[cell_idx + 1] as usize];
            if visit(cell, next_x.min(next_y)) {
                return;
            }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::solid::{Mapping, Material, Shape};
    use crate::simulate::texture::{Palette, Pattern};
    use crate::simulate::vector::{gray, vec3};
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
