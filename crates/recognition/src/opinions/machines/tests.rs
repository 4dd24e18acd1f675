use super::*;
use crate::model::tests::{config, samples};

#[test]
fn frames_are_answered_from_the_matrix_as_by_themselves() {
    for inner in [InnerKernel::Rbf { gamma: 3.0 }, InnerKernel::Correlation { gamma: 1.0 }] {
        let config = config().with_bag(|machines| {
            machines.classifier = Classifier::MatchSvm(MatchConfig { inner, ..MatchConfig::default() });
            machines.representation = Representation::Descriptors {};
        });
        let samples = samples(&config, 24, 1);
        let frames: Vec<&Seen> = samples.iter().map(|sample| &sample.features.seen[0]).collect();
        let machines_config = config.machines().unwrap();
        let prepared = Machines::prepare(machines_config, &frames, 0).unwrap();
        // A fold leaves out some of them.
        let frame_idxs: Vec<usize> = (0..24).filter(|idx| idx % 4 != 1).collect();
        let labels: Vec<usize> = frame_idxs.iter().map(|idx| idx % 3).collect();
        let chosen = Chosen { frame_idxs: &frame_idxs, labels: &labels, n_classes: 3 };
        let machines = Machines::train(machines_config, &prepared, &frames, &chosen).unwrap();
        for (frame_idx, seen) in frames.iter().enumerate() {
            let said = machines.answer(seen).unwrap();
            let from_matrix = machines.answer_prepared(&prepared, &frames, frame_idx).unwrap();
            assert_eq!(from_matrix.values, said.values);
        }
    }
}
