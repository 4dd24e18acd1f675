//! Machines over what is seen of the whole frame, a row of as many numbers as all frames have.

use crate::classify::svm;
use crate::classify::svm::LinearSvm;
use crate::file::arrays::{Array, Arrays};
use crate::file::error::FormatError;
use crate::look::lens::Lens;
use crate::look::sight::Seen;
use crate::opinions::error::{AddError, TrainError};
use crate::opinions::kept::KeptRows;
use crate::opinions::machines::{LinearArrays, MACHINE_SIGNS, signs_of};
use crate::opinions::{Added, Chosen, Clue, Left, Near, Recognizer, Said, Shape, Sign, Size};
use roomsight_vision::matrix::Matrix;

/// How linear machines over what is seen of the whole frame are trained.
pub(crate) trait WholeConfig: Clone {
    /// The cost of an error of its machines.
    fn c(&self) -> f64;

    /// The network that it looks through, if it does, to be linked.
    fn lens_mut(&mut self) -> Option<&mut Lens> {
        None
    }

    /// How its machines are trained.
    fn machines(&self) -> svm::Config {
        svm::Config { c: self.c(), ..svm::Config::default() }
    }

    /// What is wrong with the parameters beside those of its sight, if anything.
    fn check(&self) -> Result<(), String> {
        self.machines().check().map_err(|error| error.to_string())
    }

    fn is_random(&self) -> bool {
        false
    }

    fn prior_weight(&self) -> f64 {
        1.0
    }

    fn signs(&self) -> &'static [Sign] {
        &WHOLE_SIGNS
    }
}

/// The machines, and the rows that they were trained on.
#[derive(Clone, Debug)]
pub(crate) struct Whole<C> {
    config: C,
    svm: LinearSvm,
    kept: KeptRows,
}

/// What an answer tells of how familiar a frame is: beside the decision values, the cosine to the nearest row.
const WHOLE_SIGNS: [Sign; 3] =
    [MACHINE_SIGNS[0], MACHINE_SIGNS[1], Sign { name: "nearest", prior_weight: 0.5 }];

impl<C: WholeConfig> Whole<C> {
    /// Trains on kept rows alone, so that it does not matter when they came.
    fn of_kept(config: &C, kept: KeptRows, labels: &[usize], n_rooms: usize) -> Result<Self, svm::SvmError> {
        let svm = LinearSvm::train(&kept.rows(), labels, n_rooms, &config.machines())?;
        Ok(Self { config: config.clone(), svm, kept })
    }
}

impl<C: WholeConfig> Recognizer for Whole<C> {
    type Config = C;
    type Prepared = ();

    fn prepare(_: &C, _: &[&Seen], _: u64) -> Result<(), TrainError> {
        Ok(())
    }

    fn train(config: &C, (): &(), frames: &[&Seen], chosen: &Chosen) -> Result<Self, TrainError> {
        let rows = rows_of(chosen.frame_idxs.iter().map(|&idx| frames[idx]));
        let svm = LinearSvm::train(&rows, chosen.labels, chosen.n_classes, &config.machines())?;
        Ok(Self { config: config.clone(), svm, kept: KeptRows::new(&rows) })
    }

    fn answer(&self, seen: &Seen) -> Option<Said> {
        let whole = seen.whole()?;
        let values = self.svm.decision_values(whole);
        let nearest = self.kept.nearest_cosine(whole);
        let signs = signs_of(&values).into_iter().chain([nearest]).collect();
        Some(Said { values, signs })
    }

    fn check_addition(&self) -> Result<(), AddError> {
        self.kept.check()
    }

    fn add(&self, added: &Added) -> Result<Self, AddError> {
        let rows = rows_of(added.frames.iter().copied());
        let kept = self.kept.with(&rows, added).ok_or(AddError::NothingKept)?;
        Ok(Self::of_kept(&self.config, kept, added.labels, added.n_rooms)?)
    }

    fn without(&self, left: &Left) -> Result<Self, AddError> {
        let kept = self.kept.left(left).ok_or(AddError::NothingKept)?;
        Ok(Self::of_kept(&self.config, kept, left.labels, left.n_rooms)?)
    }

    fn clues(&self, _: &Seen, _: usize) -> Vec<Clue> {
        Vec::new()
    }

    fn nearest(&self, seen: &Seen, n_frames: usize) -> Vec<Near> {
        seen.whole().map_or_else(Vec::new, |whole| self.kept.nearest(whole, n_frames))
    }

    fn to_arrays(&self) -> Vec<Array> {
        let mut arrays = LinearArrays::write(&self.svm);
        arrays.extend(self.kept.to_arrays());
        arrays
    }

    fn from_arrays(config: &C, shape: Shape, arrays: &Arrays) -> Result<Self, FormatError> {
        let svm = LinearArrays { scheme: config.machines().scheme, n_features: shape.n_dimensions };
        let svm = svm.read(shape, arrays)?;
        let kept = KeptRows::from_arrays(shape.n_dimensions, shape, arrays)?;
        Ok(Self { config: config.clone(), svm, kept })
    }

    fn size(&self) -> Size {
        Size {
            n_support_vectors: self.svm.n_support_vectors().to_vec(),
            n_kept: self.kept.n_rows(),
            ..Size::default()
        }
    }
}

/// One row a frame.
fn rows_of<'a>(frames: impl Iterator<Item = &'a Seen>) -> Matrix {
    let mut rows: Option<Matrix> = None;
    for values in frames.filter_map(Seen::whole) {
        rows.get_or_insert_with(|| Matrix::new(values.len())).push_row(values);
    }
    rows.unwrap_or_else(|| Matrix::new(1))
}
