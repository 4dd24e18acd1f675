//! Furniture of kitchens, bathrooms, printer areas, labs and stairs. All measures in meters.

use super::office::{clutter, table, wood};
use crate::simulate::builder::Builder;
use crate::simulate::solid::Material;
use crate::simulate::texture::Pattern;
use crate::simulate::vector::{gray, vec3};
use rand::Rng;

fn steel(b: &mut Builder) -> Material {
    b.tiled(Pattern::Steel, 0, 0.6)
}

fn ceramic(b: &mut Builder) -> Material {
    b.paint(gray(1.1))
}

pub(super) fn printer(b: &mut Builder) {
    let variant = b.variant();
    let front = b.fitted(Pattern::Appliance, variant);
    let case = b.paint(vec3(0.8, 0.79, 0.76));
    let height = b.fixed(0.85, 1.1);
    b.fronted([[0.0, 0.32, height / 2.0], [0.66, 0.6, height]], front, case);
    let lid = b.paint(gray(0.35));
    b.block([0.0, 0.3, height + 0.04], [0.62, 0.5, 0.07], lid);
    b.block([0.4, 0.32, height * 0.7], [0.2, 0.35, 0.03], lid);
    let (x, turn, variant) = (b.varying(-0.15, 0.15), b.varying(-0.5, 0.5), b.run.random());
    let sheet = b.fitted(Pattern::Paper, variant);
    b.at([x, 0.3, height + 0.08], turn, |b| b.block([0.0, 0.0, 0.004], [0.21, 0.3, 0.01], sheet));
}

pub(super) fn boxes(b: &mut Builder) {
    let mut height = 0.0;
    for _ in 0..b.run.random_range(1..4) {
        let [width, depth, tall] = [b.varying(0.3, 0.5), b.varying(0.28, 0.42), b.varying(0.2, 0.35)];
        let turn = b.varying(-0.3, 0.3);
        let variant = b.run.random();
        let carton = b.fitted(Pattern::Cardboard, variant);
        b.at([0.0, 0.28, height], turn, |b| b.block([0.0, 0.0, tall / 2.0], [width, depth, tall], carton));
        height += tall;
    }
}

/// Cupboards below and above, a sink, a coffee machine and a microwave oven.
pub(super) fn counter(b: &mut Builder) {
    const WIDTH: f32 = 1.8;
    let variant = b.variant();
    let doors = b.fitted(Pattern::Cupboard, variant);
    let case = wood(b);
    for x in [-0.6, 0.0, 0.6] {
        b.fronted([[x, 0.3, 0.43], [0.6, 0.58, 0.86]], doors, case);
        if x < 0.5 {
            b.fronted([[x, 0.17, 1.8], [0.6, 0.34, 0.65]], doors, case);
        }
    }
    b.block([0.0, 0.31, 0.88], [WIDTH, 0.62, 0.04], case);
    let metal = steel(b);
    let sink = b.paint(gray(0.2));
    b.block([-0.5, 0.32, 0.9], [0.5, 0.42, 0.015], metal);
    b.block([-0.5, 0.32, 0.905], [0.4, 0.32, 0.012], sink);
    b.cylinder([-0.5, 0.08, 1.02], [0.04, 0.04, 0.24], metal);
    b.block([-0.5, 0.15, 1.14], [0.03, 0.18, 0.03], metal);
    let variant = b.variant();
    let oven = b.fitted(Pattern::Appliance, variant);
    let shell = b.paint(gray(0.75));
    b.fronted([[0.55, 0.25, 1.05], [0.5, 0.36, 0.3]], oven, shell);
    let x = b.varying(0.0, 0.15);
    let black = b.paint(gray(0.1));
    b.block([x, 0.25, 1.06], [0.2, 0.25, 0.32], black);
    b.cylinder([x, 0.4, 0.97], [0.14, 0.14, 0.14], metal);
    clutter(b, [WIDTH, 0.6, 0.9]);
}

pub(super) fn refrigerator(b: &mut Builder) {
    let variant = b.variant();
    let case = b.paint(gray(0.95));
    let height = b.fixed(1.5, 1.85);
    b.block([0.0, 0.3, height / 2.0], [0.6, 0.58, height], case);
    let seam = b.paint(gray(0.3));
    b.block([0.0, 0.592, height * 0.68], [0.6, 0.01, 0.015], seam);
    b.block([-0.24, 0.6, height * 0.78], [0.03, 0.03, 0.25], seam);
    b.block([-0.24, 0.6, height * 0.55], [0.03, 0.03, 0.25], seam);
    for note in 0..3 {
        let [x, z] = [b.varying(-0.15, 0.2), height * b.varying(0.72, 0.92)];
        let paper = b.fitted(Pattern::Paper, variant.wrapping_add(note));
        b.block([x, 0.594, z], [0.13, 0.01, 0.18], paper);
    }
}

pub(super) fn dining_table(b: &mut Builder) {
    let top = wood(b);
    table(b, [0.95, 0.75, 0.75], top);
    clutter(b, [0.9, 0.75, 0.75]);
    let seat = b.paint(vec3(0.6, 0.2, 0.15));
    for x in [-0.3, 0.3] {
        let at = [x + b.varying(-0.08, 0.08), 0.9 + b.varying(-0.06, 0.06), 0.0];
        let stool = |b: &mut Builder| {
            b.cylinder([0.0, 0.0, 0.45], [0.34, 0.34, 0.05], seat);
            b.cylinder([0.0, 0.0, 0.22], [0.06, 0.06, 0.42], seat);
        };
        b.at(at, 0.0, |b| b.beside_the_way(stool));
    }
}

/// Partitions, a door that is shut or ajar, and a toilet behind it.
pub(super) fn stall(b: &mut Builder) {
    const HEIGHT: f32 = 1.95;
    let panel = b.paint(vec3(0.55, 0.66, 0.68));
    for x in [-0.46, 0.46] {
        b.block([x, 0.57, HEIGHT / 2.0 + 0.1], [0.03, 1.1, HEIGHT - 0.2], panel);
    }
    let angle = if b.run.random_bool(0.5) { -b.varying(0.3, 1.2) } else { 0.0 };
    let handle = steel(b);
    b.at([-0.44, 1.1, 0.0], angle, |b| {
        b.block([0.44, 0.0, HEIGHT / 2.0 + 0.1], [0.86, 0.03, HEIGHT - 0.2], panel);
        b.block([0.78, 0.03, 1.0], [0.12, 0.03, 0.04], handle);
    });
    let white = ceramic(b);
    b.ellipsoid([0.0, 0.4, 0.3], [0.36, 0.5, 0.3], white);
    b.cylinder([0.0, 0.4, 0.15], [0.2, 0.25, 0.3], white);
    b.block([0.0, 0.1, 0.75], [0.36, 0.16, 0.35], white);
}

pub(super) fn urinal(b: &mut Builder) {
    let white = ceramic(b);
    let metal = steel(b);
    b.ellipsoid([0.0, 0.12, 0.7], [0.36, 0.4, 0.55], white);
    b.block([0.0, 0.03, 0.85], [0.34, 0.06, 0.5], white);
    b.cylinder([0.0, 0.05, 1.2], [0.04, 0.04, 0.2], metal);
    b.block([0.32, 0.1, 0.9], [0.03, 0.3, 0.8], white);
}

/// Two basins under a mirror, with soap and towels.
pub(super) fn washbasin(b: &mut Builder) {
    let white = ceramic(b);
    let metal = steel(b);
    b.block([0.0, 0.24, 0.82], [1.05, 0.48, 0.06], white);
    let hollow = b.paint(gray(0.6));
    for x in [-0.26, 0.26] {
        b.ellipsoid([x, 0.26, 0.84], [0.38, 0.3, 0.06], hollow);
        b.cylinder([x, 0.08, 0.93], [0.035, 0.035, 0.16], metal);
        b.block([x, 0.13, 1.0], [0.025, 0.12, 0.025], metal);
    }
    let glass = b.paint(vec3(0.5, 0.55, 0.58));
    let rim = b.paint(gray(0.25));
    b.block([0.0, 0.008, 1.5], [1.0, 0.016, 0.8], rim);
    b.block([0.0, 0.012, 1.5], [0.96, 0.02, 0.76], glass);
    let x = b.fixed(-0.5, 0.5);
    b.block([x, 0.08, 1.15], [0.1, 0.12, 0.22], rim);
    let towels = b.fitted(Pattern::Appliance, 0);
    b.fronted([[0.56, 0.08, 1.35], [0.26, 0.14, 0.38]], towels, metal);
}

pub(super) fn rack(b: &mut Builder) {
    let variant = b.variant();
    let front = b.fitted(Pattern::Electronics, variant);
    let case = b.paint(gray(0.18));
    b.fronted([[0.0, 0.37, 0.95], [0.6, 0.7, 1.9]], front, case);
}

/// A table of parts under repair.
pub(super) fn workbench(b: &mut Builder) {
    let top = wood(b);
    table(b, [1.45, 0.72, 0.85], top);
    let case = b.paint(vec3(0.35, 0.4, 0.5));
    for x in [-0.5, 0.0, 0.45] {
        if b.run.random_bool(0.75) {
            let variant = b.run.random();
            let front = b.fitted(Pattern::Electronics, variant);
            let (x, turn) = (x + b.varying(-0.1, 0.1), b.varying(-0.4, 0.4));
            let size = [b.varying(0.2, 0.4), b.varying(0.2, 0.35), b.varying(0.12, 0.35)];
            b.at([x, 0.35, 0.85], turn, |b| b.fronted([[0.0, 0.0, size[2] / 2.0], size], front, case));
        }
    }
    clutter(b, [1.4, 0.7, 0.85]);
}

pub(super) fn mobile_robot(b: &mut Builder) {
    let variant = b.variant();
    let body = b.paint(vec3(0.6, 0.1, 0.1));
    let black = b.paint(gray(0.08));
    let boards = b.fitted(Pattern::Electronics, variant);
    b.cylinder([0.0, 0.3, 0.2], [0.45, 0.45, 0.24], body);
    b.cylinder([0.0, 0.3, 0.36], [0.4, 0.4, 0.06], black);
    b.block([0.0, 0.3, 0.52], [0.26, 0.22, 0.26], boards);
    b.cylinder([0.0, 0.3, 0.85], [0.04, 0.04, 0.5], black);
    b.block([0.0, 0.3, 1.12], [0.14, 0.1, 0.08], black);
}

/// A flight of stairs going up along the wall, with a railing.
pub(super) fn stairs(b: &mut Builder) {
    let stone = b.tiled(Pattern::Linoleum, 1, 0.8);
    let edge = b.paint(gray(0.25));
    let metal = steel(b);
    for step in 0..9 {
        let x = -1.1 + 0.27 * step as f32;
        let height = 0.17 * (step + 1) as f32;
        b.block([x, 0.55, height / 2.0], [0.27, 1.05, height], stone);
        b.block([x - 0.125, 0.55, height + 0.004], [0.03, 1.05, 0.008], edge);
        b.cylinder([x, 1.05, height + 0.45], [0.025, 0.025, 0.9], metal);
        b.block([x, 1.05, height + 0.9], [0.28, 0.04, 0.04], metal);
    }
}

pub(super) fn extinguisher(b: &mut Builder) {
    let red = b.paint(vec3(0.75, 0.06, 0.05));
    let black = b.paint(gray(0.06));
    b.cylinder([0.0, 0.1, 0.75], [0.15, 0.15, 0.45], red);
    b.cylinder([0.0, 0.1, 1.02], [0.06, 0.06, 0.1], black);
    b.block([0.0, 0.004, 1.4], [0.2, 0.008, 0.2], red);
}
