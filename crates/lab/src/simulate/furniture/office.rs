//! Office furniture and what lies on it. All measures in meters.

use crate::simulate::builder::Builder;
use crate::simulate::solid::Material;
use crate::simulate::texture::Pattern;
use crate::simulate::vector::{gray, vec3};
use rand::Rng;
use std::f32::consts::PI;

/// The wood of a lab's furniture.
pub(super) fn wood(b: &mut Builder) -> Material {
    let variant = u32::from(b.layout.random_bool(0.3));
    b.tiled(Pattern::Wood, variant, 1.3)
}

fn dark(b: &mut Builder) -> Material {
    b.paint(gray(0.12))
}

/// A table top on two side panels.
pub(super) fn table(b: &mut Builder, [width, depth, height]: [f32; 3], material: Material) {
    b.block([0.0, depth / 2.0, height - 0.015], [width, depth, 0.03], material);
    let leg = b.paint(gray(0.4));
    for x in [-0.5, 0.5] {
        b.block(
            [x * (width - 0.06), depth / 2.0, height / 2.0 - 0.02],
            [0.04, depth - 0.1, height - 0.04],
            leg,
        );
    }
}

/// A desk with a computer, papers and a chair; somebody's mess differs from day to day.
pub(super) fn desk(b: &mut Builder, width: f32) {
    const HEIGHT: f32 = 0.74;
    let top = wood(b);
    table(b, [width, 0.75, HEIGHT], top);
    let variant = b.variant();
    let drawers = b.fitted(Pattern::Drawers, variant);
    if width > 1.2 {
        let x = if b.layout.random_bool(0.5) { 0.45 } else { -0.45 };
        b.fronted([[x, 0.4, 0.33], [0.42, 0.6, 0.6]], drawers, drawers);
    }
    let at = b.fixed(-0.2, 0.2) * width + b.varying(-0.05, 0.05);
    let turn = b.varying(-0.25, 0.25);
    b.at([at, 0.22, HEIGHT], turn, monitor);
    let (variant, turn) = (b.variant(), b.varying(-0.15, 0.15));
    let keyboard = b.fitted(Pattern::Keyboard, variant);
    b.at([at, 0.52, HEIGHT], turn, |b| b.block([0.0, 0.0, 0.012], [0.44, 0.16, 0.024], keyboard));
    clutter(b, [width, 0.75, HEIGHT]);
    let sideways = b.varying(-0.25, 0.25);
    let turn = PI + b.varying(-0.9, 0.9);
    let back = b.varying(0.82, 0.92);
    b.at([at + sideways, back, 0.0], turn, |b| b.beside_the_way(|b| chair(b, 0.0)));
}

fn monitor(b: &mut Builder) {
    let variant = b.variant();
    let is_on = b.run.random_bool(0.6);
    let case = if b.layout.random_bool(0.5) { dark(b) } else { b.paint(vec3(0.75, 0.72, 0.65)) };
    let screen = if is_on {
        let variant = if b.run.random_bool(0.5) { b.run.random() } else { variant };
        Material { glow: 0.5, ..b.fitted(Pattern::Screen, variant) }
    } else {
        b.paint(gray(0.03))
    };
    b.cylinder([0.0, 0.0, 0.01], [0.24, 0.2, 0.02], case);
    b.block([0.0, 0.0, 0.08], [0.07, 0.05, 0.14], case);
    b.fronted([[0.0, 0.03, 0.31], [0.46, 0.05, 0.36]], screen, case);
}

/// Papers, cups, books on a surface of this width, depth and height.
pub(super) fn clutter(b: &mut Builder, [width, depth, height]: [f32; 3]) {
    for _ in 0..b.run.random_range(2..6) {
        let at = [b.varying(-0.45, 0.45) * width, b.varying(0.15, 0.85) * depth, height];
        let turn = b.varying(-PI, PI);
        let kind = b.run.random_range(0..4);
        let variant = b.run.random();
        b.at(at, turn, |b| match kind {
            0 => {
                let cup = vec3(b.varying(0.1, 0.9), b.varying(0.1, 0.9), b.varying(0.1, 0.9));
                let cup = b.paint(cup);
                b.cylinder([0.0, 0.0, 0.05], [0.085, 0.085, 0.1], cup);
            }
            1 => {
                let thickness = b.varying(0.02, 0.12);
                let cover = b.fitted(Pattern::Poster, variant);
                b.block([0.0, 0.0, thickness / 2.0], [0.22, 0.29, thickness], cover);
            }
            _ => {
                let sheet = b.fitted(Pattern::Paper, variant);
                b.block([0.0, 0.0, 0.004], [0.21, 0.3, 0.008], sheet);
            }
        });
    }
}

/// A chair that faces local +y, its seat this far from y = 0.
pub(super) fn chair(b: &mut Builder, seat: f32) {
    let variant = b.variant();
    let cover = b.tiled(Pattern::Fabric, variant, 0.5);
    let frame = dark(b);
    b.block([0.0, seat, 0.46], [0.46, 0.44, 0.08], cover);
    b.block([0.0, seat - 0.22, 0.8], [0.44, 0.06, 0.5], cover);
    b.cylinder([0.0, seat, 0.24], [0.06, 0.06, 0.4], frame);
    b.block([0.0, seat, 0.04], [0.5, 0.06, 0.05], frame);
    b.block([0.0, seat, 0.04], [0.06, 0.5, 0.05], frame);
}

pub(super) fn bookshelf(b: &mut Builder) {
    let height = b.fixed(1.7, 2.1);
    let variant = b.variant();
    let books = b.fitted(Pattern::Books, variant);
    let case = wood(b);
    b.fronted([[0.0, 0.16, height / 2.0], [0.9, 0.3, height]], books, case);
    if b.run.random_bool(0.4) {
        let x = b.varying(-0.2, 0.2);
        let carton = b.fitted(Pattern::Cardboard, 0);
        b.block([x, 0.15, height + 0.12], [0.35, 0.25, 0.24], carton);
    }
}

pub(super) fn cupboard(b: &mut Builder) {
    let height = b.fixed(0.9, 1.35);
    let variant = b.variant();
    let doors = b.fitted(Pattern::Cupboard, variant);
    let case = wood(b);
    b.fronted([[0.0, 0.22, height / 2.0], [0.88, 0.42, height]], doors, case);
    clutter(b, [0.8, 0.42, height]);
}

pub(super) fn whiteboard(b: &mut Builder) {
    let variant = if b.run.random_bool(0.5) { b.run.random() } else { 0 };
    let board = b.fitted(Pattern::Whiteboard, variant);
    let rail = b.paint(gray(0.5));
    b.fronted([[0.0, 0.015, 1.5], [1.5, 0.03, 1.0]], board, rail);
    b.block([0.0, 0.05, 0.98], [1.3, 0.08, 0.02], rail);
}

pub(super) fn coat_rack(b: &mut Builder) {
    let pole = dark(b);
    b.cylinder([0.0, 0.2, 0.9], [0.05, 0.05, 1.8], pole);
    b.cylinder([0.0, 0.2, 0.02], [0.4, 0.4, 0.04], pole);
    for _ in 0..b.run.random_range(0..4) {
        let variant = b.run.random();
        let coat = b.tiled(Pattern::Fabric, variant, 0.6);
        let side = b.varying(-0.12, 0.12);
        b.ellipsoid([side, 0.22, 1.25], [0.28, 0.3, 0.9], coat);
    }
}

pub(super) fn sofa(b: &mut Builder) {
    let variant = b.variant();
    let cover = b.tiled(Pattern::Fabric, variant, 0.7);
    b.block([0.0, 0.42, 0.22], [1.6, 0.7, 0.4], cover);
    b.block([0.0, 0.1, 0.5], [1.6, 0.2, 0.7], cover);
    for x in [-0.75, 0.75] {
        b.block([x, 0.4, 0.35], [0.15, 0.75, 0.6], cover);
    }
    let x = b.varying(-0.5, 0.5);
    let cushion = b.paint(vec3(0.7, 0.35, 0.25));
    b.ellipsoid([x, 0.3, 0.55], [0.45, 0.25, 0.4], cushion);
}

pub(super) fn plant(b: &mut Builder) {
    let pot = b.paint(vec3(0.6, 0.35, 0.25));
    let leaves = b.tiled(Pattern::Leaves, 0, 0.4);
    let height = b.fixed(0.6, 1.3);
    b.cylinder([0.0, 0.25, 0.15], [0.3, 0.3, 0.3], pot);
    b.cylinder([0.0, 0.25, height / 2.0], [0.04, 0.04, height], pot);
    for _ in 0..4 {
        let [x, y] = [b.fixed(-0.12, 0.12), b.fixed(0.15, 0.35)];
        let z = height + b.fixed(-0.25, 0.2);
        let size = b.fixed(0.25, 0.45);
        b.ellipsoid([x, y, z], [size, size, size * 1.2], leaves);
    }
}

pub(super) fn bin(b: &mut Builder) {
    let shade = b.fixed(0.15, 0.6);
    let body = b.paint(vec3(shade, shade, shade * 1.1));
    b.cylinder([0.0, 0.18, 0.18], [0.28, 0.28, 0.36], body);
    if b.run.random_bool(0.5) {
        let rubbish = b.paint(gray(0.9));
        b.ellipsoid([0.0, 0.18, 0.34], [0.2, 0.2, 0.16], rubbish);
    }
}

/// A piece of a conference table with a chair on either side.
pub(super) fn conference_table(b: &mut Builder) {
    let top = b.tiled(Pattern::Wood, 2, 1.3);
    b.block([0.0, 0.55, 0.72], [1.2, 1.1, 0.04], top);
    let leg = b.paint(gray(0.3));
    b.cylinder([0.0, 0.55, 0.35], [0.12, 0.12, 0.7], leg);
    b.at([0.0, 0.05, 0.0], 0.0, |b| clutter(b, [1.1, 1.0, 0.74]));
    for (y, turn) in [(-0.12, 0.0), (1.22, PI)] {
        let turn = turn + b.varying(-0.4, 0.4);
        let x = b.varying(-0.15, 0.15);
        b.at([x, y, 0.0], turn, |b| b.beside_the_way(|b| chair(b, 0.0)));
    }
}
