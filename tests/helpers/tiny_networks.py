"""A block matcher as an ONNX graph: a stereo network without weights, in whatever dress the tests need."""

import numpy as np
from onnx import TensorProto, helper, numpy_helper, save

LABELS = 24


class Graph:
    """Nodes and constants in the making."""

    def __init__(self):
        self.nodes, self.constants = [], []

    def add(self, kind, *inputs, **attributes):
        name = f"t{len(self.nodes)}"
        self.nodes.append(helper.make_node(kind, list(inputs), [name], **attributes))
        return name

    def constant(self, values, kind=np.int64):
        name = f"c{len(self.constants)}"
        self.constants.append(numpy_helper.from_array(np.array(values, kind), name))
        return name

    def cut(self, tensor, axis, start, end):
        return self.add("Slice", tensor, *(self.constant([v]) for v in (start, end, axis)))


def write_network(
    path, *, inputs=("left", "right"), layout="NCHW", channels=3, sign=1, second=False, half=(), extra=()
):
    """Save a graph that finds disparities 0 .. LABELS - 1 by windows of 5 px.

    One input: both images, stacked. second: the disparity is channel 1 of 2. half: inputs of half the size, which are
    compared and only count (times 0). extra: names of operators put on the output, such as "Log".
    """
    graph = Graph()
    per_input = channels * (2 if len(inputs) == 1 else 1)
    seen = [graph.add("Transpose", n, perm=[0, 3, 1, 2]) if layout == "NHWC" else n for n in inputs]
    if len(inputs) == 1:
        seen = [graph.cut(seen[0], 1, 0, channels), graph.cut(seen[0], 1, channels, 2 * channels)]
    costs = [cost(graph, *seen, d) for d in range(LABELS)]
    found = graph.add("Cast", graph.add("ArgMin", graph.add("Concat", *costs, axis=1), axis=1), to=TensorProto.FLOAT)
    for name in half:
        found = graph.add("Add", found, graph.add("Mul", mean(graph, name), graph.constant(0, np.float32)))
    if sign < 0:
        found = graph.add("Neg", found)
    for kind in extra:
        found = graph.add(kind, found)
    if second:
        found = graph.add("Concat", graph.add("Neg", found), found, axis=1)
    if layout == "NHWC":
        found = graph.add("Transpose", found, perm=[0, 2, 3, 1])
    graph.nodes.append(helper.make_node("Identity", [found], ["disparity"]))
    shape = [1, per_input, "h", "w"] if layout == "NCHW" else [1, "h", "w", per_input]
    fed = [helper.make_tensor_value_info(n, TensorProto.FLOAT, shape) for n in inputs]
    fed += [helper.make_tensor_value_info(n, TensorProto.FLOAT, [1, channels, "h2", "w2"]) for n in half]
    made = helper.make_tensor_value_info("disparity", TensorProto.FLOAT, None)
    model = helper.make_model(
        helper.make_graph(graph.nodes, "tiny", fed, [made], graph.constants),
        opset_imports=[helper.make_opsetid("", 13)],
        ir_version=8,
    )
    save(model, path)


def cost(graph, left, right, d):
    """Mean absolute difference (1, 1, H, W) of left and right shifted by d columns."""
    if d:
        padded = graph.add("Pad", right, graph.constant([0, 0, 0, d, 0, 0, 0, 0]), mode="edge")
        right = graph.cut(padded, 3, 0, -d)
    difference = graph.add("Abs", graph.add("Sub", left, right))
    grey = graph.add("ReduceMean", difference, axes=[1], keepdims=1)
    return graph.add("AveragePool", grey, kernel_shape=[5, 5], pads=[2, 2, 2, 2])


def mean(graph, name):
    return graph.add("ReduceMean", name, axes=[0, 1, 2, 3], keepdims=1)
