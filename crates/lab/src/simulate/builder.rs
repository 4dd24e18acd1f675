//! Puts solids, lights and panes into a lab, in the coordinates of whatever is being furnished.

use super::light::{Light, Pane};
use super::plan::Rect;
use super::solid::{Mapping, Material, Shape, Solid};
use super::texture::{Palette, Pattern};
use super::vector::{Color, Vec3, gray, vec3};
use rand::Rng;
use rand_chacha::ChaCha8Rng;

/// A place to build at: local x to the left of someone who looks at it, y toward them, z up.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    pub origin: Vec3,
    pub yaw: f32,
}

impl Frame {
    /// The frame at a local point, turned by `yaw` more.
    pub fn moved(&self, to: [f32; 3], yaw: f32) -> Self {
        Self { origin: self.point(to), yaw: self.yaw + yaw }
    }

    /// A local point in the coordinates of the plan.
    pub fn point(&self, [x, y, z]: [f32; 3]) -> Vec3 {
        self.origin + vec3(x, y, z).turned(self.yaw.cos(), self.yaw.sin())
    }
}

/// What is being built, and the two sources of chance: `layout` is the same in every sequence of a lab,
/// `run` differs from sequence to sequence.
pub(super) struct Builder {
    pub solids: Vec<Solid>,
    pub lights: Vec<Light>,
    pub panes: Vec<Pane>,
    pub palette: Palette,
    pub frame: Frame,
    pub room_idx: usize,
    pub layout: ChaCha8Rng,
    pub run: ChaCha8Rng,
    /// Points of the robot's way, where nothing may stand.
    way: Vec<[f32; 2]>,
}

impl Builder {
    pub fn new([layout, run]: [ChaCha8Rng; 2], way: Vec<[f32; 2]>) -> Self {
        Self {
            solids: Vec::new(),
            lights: Vec::new(),
            panes: Vec::new(),
            palette: Palette::default(),
            frame: Frame { origin: Vec3::default(), yaw: 0.0 },
            room_idx: 0,
            layout,
            run,
            way,
        }
    }

    /// Builds something at a local point, turned by `yaw`.
    pub fn at(&mut self, to: [f32; 3], yaw: f32, build: impl FnOnce(&mut Self)) {
        let outer = self.frame;
        self.frame = outer.moved(to, yaw);
        build(self);
        self.frame = outer;
    }

    /// Builds something, and takes it away again if it is in the robot's way.
    pub fn beside_the_way(&mut self, build: impl FnOnce(&mut Self)) {
        const CLEARANCE: f32 = 0.27;
        let n_solids = self.solids.len();
        build(self);
        let blocks = |solid: &Solid| {
            let [x0, y0, x1, y1] = solid.footprint();
            let floor =
                Rect { x0: x0 - CLEARANCE, y0: y0 - CLEARANCE, x1: x1 + CLEARANCE, y1: y1 + CLEARANCE };
            self.way.iter().any(|&[x, y]| floor.contains(x, y))
        };
        if self.solids[n_solids..].iter().any(blocks) {
            self.solids.truncate(n_solids);
        }
    }

    /// A box of this size round a local point.
    pub fn block(&mut self, center: [f32; 3], size: [f32; 3], material: Material) {
        self.push(Shape::Box, [center, size], [material; 2]);
    }

    /// A box whose side toward local y looks different.
    pub fn fronted(&mut self, place: [[f32; 3]; 2], front: Material, rest: Material) {
        self.push(Shape::Box, place, [front, rest]);
    }

    pub fn cylinder(&mut self, center: [f32; 3], size: [f32; 3], material: Material) {
        self.push(Shape::Cylinder, [center, size], [material; 2]);
    }

    pub fn ellipsoid(&mut self, center: [f32; 3], size: [f32; 3], material: Material) {
        self.push(Shape::Ellipsoid, [center, size], [material; 2]);
    }

    /// A pattern repeated every so many meters.
    pub fn tiled(&mut self, pattern: Pattern, variant: u32, meters: f32) -> Material {
        let texture = self.palette.texture(pattern, variant);
        Material { texture, tint: gray(1.0), mapping: Mapping::Tiled(meters), glow: 0.0 }
    }

    /// A pattern once over a face.
    pub fn fitted(&mut self, pattern: Pattern, variant: u32) -> Material {
        let texture = self.palette.texture(pattern, variant);
        Material { texture, tint: gray(1.0), mapping: Mapping::Fitted, glow: 0.0 }
    }

    /// A coat of plain paint.
    pub fn paint(&mut self, tint: Color) -> Material {
        Material { tint, ..self.tiled(Pattern::Paint, 0, 0.7) }
    }

    /// A number from the layout, the same in every sequence.
    pub fn fixed(&mut self, low: f32, high: f32) -> f32 {
        self.layout.random_range(low..high)
    }

    /// A number that differs from sequence to sequence.
    pub fn varying(&mut self, low: f32, high: f32) -> f32 {
        self.run.random_range(low..high)
    }

    /// A texture's variant from the layout.
    pub fn variant(&mut self) -> u32 {
        self.layout.random()
    }

    fn push(&mut self, shape: Shape, [center, size]: [[f32; 3]; 2], [front, rest]: [Material; 2]) {
        let center = self.frame.point(center);
        let half = vec3(size[0], size[1], size[2]) * 0.5;
        let turn = [self.frame.yaw.cos(), self.frame.yaw.sin()];
        self.solids.push(Solid { shape, center, half, turn, front, rest });
    }
}
