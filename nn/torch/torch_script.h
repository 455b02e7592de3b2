// TorchScript without libtorch: what legged_gym's PolicyExporterLSTM writes (unitree_rl_gym's policies: an LSTM of one
// layer, then linear layers with ELU between them; its memory lives in the module), and policies of linear, recurrent
// and normalising layers by their own code (nn/torch/torch_script.h). Any other is refused.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "duet/nn/network.h"
#include "duet/nn/onnx/onnx_model.h"
#include "duet/nn/torch/torch_archive.h"

namespace duet {

// Makes networks, each of one input "x", one output "action". A recurrent one is stateful: run() moves its memory on,
// reset() zeroes it. Throws InputError naming file, place, expected and found.
std::function<std::unique_ptr<Network>()> torch_script_maker(std::string_view bytes, const std::string& file);
std::unique_ptr<Network> torch_script_network(std::string_view bytes, const std::string& file);

// TorchScript modules of linear, recurrent and normalising layers (torch.fx's GraphModule, nn.Sequential, the exporters
// of IsaacLab and rsl_rl, and modules of such): what their own code says becomes a graph of ONNX operators. Internal to
// nn/.

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

// The code that a TorchScript archive keeps of a module's methods, as PyTorch prints it: a small part of Python, one
// expression a line. It is read, not run. Internal to nn/. Thread-safe.

struct TorchExpression {
  // kName: "x", "self.actor", "None", "True"; kCall: a function of that name; kMethod: of parts[0]; kIndex: parts[0] at
  // parts[1]; kTuple: also a list.
  enum class Kind { kName, kNumber, kText, kCall, kMethod, kTuple, kIndex };
  Kind kind = Kind::kName;
  std::string name;  // of a kName, a kCall's function, a kMethod's method; the text of a kText
  double number = 0.0;
  std::vector<TorchExpression> parts;  // arguments; a kMethod's and a kIndex's object first
  std::vector<std::string> keys;       // of each part of a call: "" or the name that it is given by
};

struct TorchStatement {
  enum class Kind { kAssign, kReturn, kIf, kPass };
  Kind kind = Kind::kPass;
  std::string line;                   // for messages
  std::vector<std::string> targets;   // of kAssign: more than one where a tuple is taken apart
  TorchExpression value;              // of kIf the condition
  std::vector<TorchStatement> block;  // of kIf
  std::vector<TorchStatement> other;  // its else
};

struct TorchFunction {
  std::vector<std::string> arguments;  // without self
  std::vector<std::string> types;      // of these: "Tensor"
  std::vector<TorchStatement> body;
};

// A line that is no such code, of the method.
struct TorchCodeFault {
  std::string line;
};

// The method of a class's text; none where it has none. Throws TorchCodeFault.
std::optional<TorchFunction> torch_method(std::string_view class_source, std::string_view method);

}  // namespace duet
