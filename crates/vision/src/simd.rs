//! The inner loops, compiled once for any CPU, once for AVX2 and once for AVX-512.
//!
//! Each kernel is written once, in plain Rust over fixed-width blocks that the compiler turns into vector
//! instructions; where it knows none, others are named beside the plain ones. They compute with whole numbers, or with
//! floats that are never summed in another order nor multiplied and added in one step, so every version gives the same
//! bits and a model answers the same on every CPU. The only unsafe code of the project is here: calling a version once the
//! CPU is known to have its instructions, executing these, and reading pixels whose place was checked before. No argument
//! of a public function makes it unsound; those that fit no promise panic.

#![allow(
    unsafe_code,
    reason = "calling a function compiled for more than the baseline instruction set is unsafe"
)]

mod bytes;
mod clusters;
mod corner;
#[cfg(target_arch = "x86_64")]
mod cpu;
mod dct;
mod dot;
mod fast;
mod hessian;
mod histogram;
mod luma;
mod nearest;
mod pattern;
mod plane;
mod project;
mod rows;
mod sketches;

pub use bytes::{ByteColumns, ByteRows, MAX_BYTES, Nearest};
pub use clusters::{Assignment, GROUP, GroupedRows, MeasuredPoints, approach, reassign};
pub use corner::{derivative_products, harris_measure, mark_maxima};
pub use dct::{Block, inverse_dct};
pub use dot::dot;
pub use fast::fast_strengths;
pub use hessian::{FilterRow, PEAK_BLOCK, hessian_row, mark_peaks};
pub use histogram::{
    CellHistograms, CellRow, N_CELL_DIRECTIONS, N_CELLS, N_DIRECTIONS, count_directions, share_gradients,
};
pub use luma::{luma, luma_of};
pub use nearest::{MeasuredRows, Nearness, UnitColumns, largest_products, nearest_columns};
pub use pattern::{
    CODE_BLOCK, COUNT_BLOCK, GRID_BLOCK, Grid, Taps, count_codes, interpolate_grid, mark_brighter,
};
pub use plane::{blur_columns, blur_row, gradients, mark_extrema};
pub use project::LinearMap;
pub use rows::{ONE, ONE_PRODUCT, ROUNDING, UnitRows};
pub use sketches::{MAX_IN_COLUMN, SKETCH, SketchColumns, SketchRow, scores_at_least, sketch_scores};

/// Defines `$name` as `$kernel`, compiled for the widest vectors that the CPU has.
macro_rules! dispatch {
    ($(#[$doc:meta])* $name:ident, $kernel:ident, ($($arg:ident: $type:ty),* $(,)?)) => {
        $(#[$doc])*
        pub fn $name($($arg: $type),*) {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2")]
                fn with_avx2($($arg: $type),*) {
                    $kernel($($arg),*);
                }

                #[target_feature(enable = "avx512f,avx512bw,avx512vl")]
                fn with_avx512($($arg: $type),*) {
                    $kernel($($arg),*);
                }

                use std::arch::is_x86_feature_detected as has;
                if has!("avx512f") && has!("avx512bw") && has!("avx512vl") {
                    // SAFETY: the CPU has all that the function asks for.
                    return unsafe { with_avx512($($arg),*) };
                }
                if has!("avx2") {
                    // SAFETY: the CPU has all that the function asks for.
                    return unsafe { with_avx2($($arg),*) };
                }
            }
            $kernel($($arg),*);
        }
    };
}

/// Calls `$kernel` with the widest instructions that the CPU has, in a function compiled for them: for what no plain Rust
/// is compiled to. The module has `Plain` for all other CPUs.
macro_rules! with_instructions {
    ($kernel:ident, $wide:ident: $features:literal, ($($arg:ident: $type:ty),* $(,)?) $(-> $output:ty)?) => {{
        #[cfg(target_arch = "x86_64")]
        {
            use crate::simd::cpu::{Avx2, $wide};

            #[target_feature(enable = "avx2")]
            fn with_avx2(avx2: Avx2, $($arg: $type),*) $(-> $output)? {
                $kernel(avx2, $($arg),*)
            }

            #[target_feature(enable = $features)]
            fn with_wide(wide: $wide, $($arg: $type),*) $(-> $output)? {
                $kernel(wide, $($arg),*)
            }

            if let Some(wide) = $wide::detected() {
                // SAFETY: the CPU has all that the function asks for.
                return unsafe { with_wide(wide, $($arg),*) };
            }
            if let Some(avx2) = Avx2::detected() {
                // SAFETY: the CPU has all that the function asks for.
                return unsafe { with_avx2(avx2, $($arg),*) };
            }
        }
        $kernel(Plain, $($arg),*)
    }};
}

use dispatch;
use with_instructions;
