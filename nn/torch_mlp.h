// TorchScript modules of linear, recurrent and normalising layers (torch.fx's GraphModule, nn.Sequential, the exporters
// of IsaacLab and rsl_rl, and modules of such): what their own code says becomes a graph of ONNX operators. Internal to
// nn/.
#pragma once

#include <string>
#include <vector>

#include "duet/nn/onnx_model.h"
#include "duet/nn/torch_archive.h"

namespace duet {

// A state that a module keeps from one evaluation to the next: an input of the graph, and the output that follows it.
struct TorchState {
  std::string input, output;
};

struct TorchGraph {
  OnnxGraph graph;  // one input "x", one output "action"; behind them those of the states, in their order
  std::vector<TorchState> states;
};

// Throws as TorchArchive::refuse for a module, a line of its code or a tensor that is none of these.
TorchGraph torch_graph(const TorchArchive& archive);

}  // namespace duet
