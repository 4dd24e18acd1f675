//! Which operators a network may use, and how much work each is.
//!
//! Those of convolutional networks and transformers that look at one picture. An operator that is not here
//! (recurrent cells, sequences, those that draw random numbers or loop) is refused: how long it takes cannot be
//! told from the sizes of what goes in and comes out.

/// What the work of an operator follows from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Work {
    /// The numbers that go in and come out.
    Elements,
    /// A convolution: numbers that come out, times weights of one filter. Which input the filters are.
    Convolution { filters: usize },
    /// A transposed convolution: numbers that go in, times weights of one input channel. Which input the filters are.
    Transposed { filters: usize },
    /// A product of matrices: numbers that come out, times the longest side of the left matrix.
    Product,
    /// A sum of products by an equation of at most two inputs.
    Einsum,
    /// A window that is moved: numbers that come out, times the window's.
    Window,
}

/// How much work `operator` of ONNX's own domain is; `None` for one that is not allowed.
pub(super) fn work(operator: &str) -> Option<Work> {
    match operator {
        "Conv" | "ConvInteger" => Some(Work::Convolution { filters: 1 }),
        "QLinearConv" => Some(Work::Convolution { filters: 3 }),
        "ConvTranspose" => Some(Work::Transposed { filters: 1 }),
        "Gemm" | "MatMul" | "MatMulInteger" | "QLinearMatMul" => Some(Work::Product),
        "Einsum" => Some(Work::Einsum),
        "AveragePool" | "LpPool" | "LRN" | "MaxPool" => Some(Work::Window),
        _ => ELEMENTS.binary_search(&operator).is_ok().then_some(Work::Elements),
    }
}

/// Whether `operator` does something again and again, or runs one of several graphs.
pub(super) fn is_control_flow(operator: &str) -> bool {
    matches!(operator, "If" | "Loop" | "Scan" | "SequenceMap")
}

/// Whether the number of dimensions of what comes out follows from values, not from sizes, of what goes in
/// behind the first input (of `ConstantOfShape` from the first).
pub(super) fn rank_follows_from_values(operator: &str) -> bool {
    matches!(operator, "ConstantOfShape" | "Expand" | "Reshape" | "Squeeze" | "Unsqueeze")
        || operator.starts_with("Reduce")
}

/// Sorted.
const ELEMENTS: [&str; 106] = [
    "Abs",
    "Add",
    "And",
    "ArgMax",
    "ArgMin",
    "BatchNormalization",
    "Cast",
    "CastLike",
    "Ceil",
    "Celu",
    "Clip",
    "Concat",
    "Constant",
    "ConstantOfShape",
    "Cos",
    "CumSum",
    "DepthToSpace",
    "DequantizeLinear",
    "Div",
    "Dropout",
    "DynamicQuantizeLinear",
    "Elu",
    "Equal",
    "Erf",
    "Exp",
    "Expand",
    "Flatten",
    "Floor",
    "Gather",
    "GatherElements",
    "GatherND",
    "Gelu",
    "GlobalAveragePool",
    "GlobalMaxPool",
    "Greater",
    "GreaterOrEqual",
    "GroupNormalization",
    "HardSigmoid",
    "HardSwish",
    "Hardmax",
    "Identity",
    "InstanceNormalization",
    "LayerNormalization",
    "LeakyRelu",
    "Less",
    "LessOrEqual",
    "Log",
    "LogSoftmax",
    "LpNormalization",
    "Max",
    "Mean",
    "MeanVarianceNormalization",
    "Min",
    "Mish",
    "Mod",
    "Mul",
    "Neg",
    "Not",
    "Or",
    "PRelu",
    "Pad",
    "Pow",
    "QuantizeLinear",
    "RMSNormalization",
    "Range",
    "Reciprocal",
    "ReduceL1",
    "ReduceL2",
    "ReduceLogSum",
    "ReduceLogSumExp",
    "ReduceMax",
    "ReduceMean",
    "ReduceMin",
    "ReduceProd",
    "ReduceSum",
    "ReduceSumSquare",
    "Relu",
    "Reshape",
    "Resize",
    "Round",
    "Selu",
    "Shape",
    "Sigmoid",
    "Sign",
    "Sin",
    "Size",
    "Slice",
    "Softmax",
    "Softplus",
    "Softsign",
    "SpaceToDepth",
    "Split",
    "Sqrt",
    "Squeeze",
    "Sub",
    "Sum",
    "Swish",
    "Tanh",
    "ThresholdedRelu",
    "Tile",
    "Transpose",
    "Trilu",
    "Unsqueeze",
    "Upsample",
    "Where",
    "Xor",
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_list_is_sorted_and_without_what_cannot_be_bounded() {
        assert!(ELEMENTS.is_sorted());
        for operator in ["Loop", "If", "Scan", "LSTM", "RandomNormal", "NonMaxSuppression", "Nonsense", ""] {
            assert_eq!(work(operator), None, "{operator}");
        }
        assert_eq!(work("Relu"), Some(Work::Elements));
        assert_eq!(work("Abs"), Some(Work::Elements));
    }
}
