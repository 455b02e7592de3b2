#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <optional>
#include <set>

#include "duet/core/require.h"
#include "duet/nn/torch/torch_archive.h"
#include "duet/nn/torch/torch_script.h"

namespace duet {
namespace {

constexpr int kDeepest = 8;         // modules within modules
constexpr int kMostModules = 1000;  // of a file that means no harm
constexpr std::int64_t kMostNumbers = std::int64_t{1} << 26;
constexpr std::string_view kTorchModules = "__torch__.torch.nn.modules.";

struct Activation {
  std::string_view module, op;
  const char* parameter;  // its name in the module's code; the operator's `alpha`; null: none
};
constexpr Activation kActivations[] = {
    {"activation.ELU", "Elu", "alpha"},   {"activation.LeakyReLU", "LeakyRelu", "negative_slope"},
    {"activation.ReLU", "Relu", nullptr}, {"activation.Sigmoid", "Sigmoid", nullptr},
    {"activation.Tanh", "Tanh", nullptr}, {"linear.Identity", "Identity", nullptr},
};

// Functions of tensors that are an operator of ONNX.
struct Function {
  std::string_view name, op;
  int arguments;
};
constexpr Function kFunctions[] = {
    {"torch.add", "Add", 2},
    {"torch.sub", "Sub", 2},
    {"torch.mul", "Mul", 2},
    {"torch.div", "Div", 2},
    {"torch.sqrt", "Sqrt", 1},
    {"torch.neg", "Neg", 1},
    {"torch.exp", "Exp", 1},
    {"torch.abs", "Abs", 1},
    {"torch.tanh", "Tanh", 1},
    {"torch.relu", "Relu", 1},
    {"torch.pow", "Pow", 2},
    {"torch.sigmoid", "Sigmoid", 1},
    {"torch.reciprocal", "Reciprocal", 1},
};

// Functions of a tensor and a number, which is the operator's `alpha`: what a traced module's code calls.
constexpr Function kShapedFunctions[] = {{"torch.elu", "Elu", 2}, {"torch.leaky_relu", "LeakyRelu", 2}};

// Functions that change nothing of one row of numbers.
constexpr std::string_view kUnchanged[] = {"torch.unsqueeze", "torch.squeeze", "torch.detach", "torch.contiguous",
                                           "torch.to",        "torch.clone",   "torch.float",  "torch.dropout",
                                           "torch.slice",     "torch.flatten"};

// Without the numbers by which TorchScript tells classes of one name apart: "linear.___torch_mangle_0.Linear".
std::string plain_name(std::string name) {
  for (std::size_t at = name.find("___torch_mangle_"); at != std::string::npos; at = name.find("___torch_mangle_", at))
    name.erase(at, name.find('.', at) - at + 1);
  return name;
}

// The value that an expression of the code stands for.
struct Value {
  enum class Kind { kNone, kNumber, kGraph, kStored, kTuple };
  Kind kind = Kind::kNone;
  double number = 0.0;
  std::string name{};          // kGraph: of the graph's value
  std::string member{};        // kGraph: the state that it is, at the beginning
  int node = -1;               // kStored: in the pickle
  std::string path{};          // of it
  std::vector<Value> parts{};  // kTuple
};

class GraphReader {
 public:
  explicit GraphReader(const TorchArchive& archive) : archive_(archive), pickle_(read_torch_pickle(archive)) {
    made_.graph.file = archive.file;
    made_.graph.opset = kNewestOpset;
  }

  TorchGraph read() {
    find_states();
    const Value x{.kind = Value::Kind::kGraph, .name = "x"};
    const Value last = call(pickle_.root, "module", "forward", {x}, 0);
    if (inputs_ == 0 || last.kind != Value::Kind::kGraph) refuse("none");
    add("action", "Identity", {last.name}, "action");
    OnnxGraph& graph = made_.graph;
    graph.inputs.insert(graph.inputs.begin(), {"x", {1, inputs_}});
    graph.outputs = {{"action", {}}};
    for (TorchState& state : made_.states) {
      const auto update = updates_.find(state.input);
      if (update == updates_.end()) refuse(fmt::format("no new value of '{}'", state.input));
      state.output = state.input + "/next";
      add(state.output, "Identity", {update->second}, state.output);
      graph.outputs.push_back({state.output, {}});
    }
    return std::move(made_);
  }

 private:
  using Scope = std::map<std::string, Value>;
  struct Frame {
    const TorchNode& object;
    std::string path;
    int depth;
    Scope values;
  };

  [[noreturn]] void refuse(const std::string& found) const {
    archive_.refuse(
        fmt::format("expected a policy of linear, recurrent and normalising layers, found {} (TorchScript of another "
                    "kind; needs libtorch)",
                    excerpt(found, kShownSentence)));
  }
  [[noreturn]] void refuse_line(const std::string& line, const std::string& path) const {
    refuse(fmt::format("the line '{}' in the code of '{}'", excerpt(line), path));
  }

  OnnxNode& add(const std::string& name, std::string_view op, std::vector<std::string> inputs, std::string output) {
    made_.graph.nodes.push_back({.name = name,
                                 .op = std::string(op),
                                 .inputs = std::move(inputs),
                                 .outputs = {std::move(output)},
                                 .attributes = {}});
    return made_.graph.nodes.back();
  }
  Value graph_value(std::string name) { return {.kind = Value::Kind::kGraph, .name = std::move(name)}; }
  Value add_value(const std::string& name, std::string_view op, std::vector<std::string> inputs) {
    std::string output = fmt::format("value{}", made_.graph.nodes.size());
    add(name, op, std::move(inputs), output);
    return graph_value(output);
  }
  void take_size(std::int64_t size) {
    if (inputs_ == 0) inputs_ = size;
  }

  // ---- members and constants

  const TorchNode* find_member(const TorchNode& object, const std::string& name) const {
    const auto found = object.members.find(name);
    return found == object.members.end() ? nullptr : &pickle_.nodes[found->second];
  }
  const TorchNode& member(const TorchNode& object, const std::string& path, const std::string& name) const {
    const TorchNode* const found = find_member(object, name);
    if (found == nullptr) refuse(fmt::format("'{}' without a member '{}'", path, name));
    return *found;
  }

  // A number that stands in the class's code, as `alpha : Final[float] = 1.`; of the member where there is one.
  [[nodiscard]] std::optional<double> find_number(const TorchNode& object, const std::string& name) const {
    if (const TorchNode* const held = find_member(object, name)) {
      if (held->kind == TorchKind::kReal) return held->real;
      if (held->kind == TorchKind::kNumber) return static_cast<double>(held->number);
    }
    const std::string source = class_source(object.text);
    for (const char* kind : {"float", "int", "bool"}) {
      const std::string line = fmt::format("  {} : Final[{}] = ", name, kind);
      const std::size_t at = source.find(line);
      if (at == std::string::npos) continue;
      std::string text = source.substr(at + line.size(), source.find('\n', at) - at - line.size());
      if (text == "True" || text == "False") return text == "True" ? 1.0 : 0.0;
      if (text.ends_with('.')) text += '0';
      return parse_number(text);
    }
    return std::nullopt;
  }

  // The tensor's numbers out of its storage, by its strides; `of` name.
  std::vector<float> numbers(const std::string& name, const TorchNode& tensor) {
    const bool twice = tensor.text == "torch.DoubleStorage";
    if (tensor.text != "torch.FloatStorage" && !twice) refuse(fmt::format("numbers of '{}' that are not float", name));
    const auto storage = archive_.tensors.find(tensor.storage);
    if (storage == archive_.tensors.end()) refuse(fmt::format("no 'data/{}' for '{}'", tensor.storage, name));
    const std::vector<float>& held = twice ? storage->second : archive_.finite(tensor.storage);
    const auto count = static_cast<std::int64_t>(held.size() / (twice ? 2 : 1));
    if (!fits(tensor, count))
      refuse(fmt::format("'{}', whose sizes do not fit the {} numbers of its storage", name, count));
    std::vector<float> values;
    std::vector<std::int64_t> place(tensor.sizes.size(), 0);
    do {
      std::int64_t at = tensor.number;
      for (std::size_t d = 0; d < place.size(); ++d) at += place[d] * tensor.strides[d];
      values.push_back(twice ? from_double(held, at) : held[static_cast<std::size_t>(at)]);
    } while (advance(place, tensor.sizes));
    if ((numbers_ += static_cast<std::int64_t>(values.size())) > kMostNumbers)
      refuse(fmt::format("more than {} numbers", kMostNumbers));
    for (const float value : values)
      if (!std::isfinite(value)) refuse(fmt::format("numbers of '{}' that are not finite", name));
    return values;
  }

  static float from_double(const std::vector<float>& held, std::int64_t at) {
    double value = 0.0;
    std::memcpy(&value, held.data() + 2 * at, sizeof value);
    return static_cast<float>(value);
  }

  // The next place, the last dimension first; false behind the last one.
  static bool advance(std::vector<std::int64_t>& place, const std::vector<std::int64_t>& sizes) {
    for (std::size_t d = place.size(); d-- > 0;) {
      if (++place[d] < sizes[d]) return true;
      place[d] = 0;
    }
    return false;
  }

  // Whether every number of the tensor is one of the `held` of its storage, and each but once.
  static bool fits(const TorchNode& tensor, std::int64_t held) {
    const std::size_t rank = tensor.sizes.size();
    if (rank > 3 || rank != tensor.strides.size() || tensor.number < 0) return false;
    std::int64_t count = 1, last = tensor.number;
    for (std::size_t d = 0; d < rank; ++d) {
      const std::int64_t size = tensor.sizes[d], stride = tensor.strides[d];
      if (size < 1 || size > held / count || (size > 1 && (stride < 1 || stride > held))) return false;
      if (size == 1 && (stride < 0 || stride > held)) return false;
      count *= size;
      last += (size - 1) * stride;
    }
    return last < held;
  }

  std::string constant(const std::string& name, const TorchNode& tensor) {
    OnnxTensor made{
        .type = ElementType::kFloat, .shape = tensor.sizes, .floats = numbers(name, tensor), .integers = {}};
    made_.graph.constants[name] = std::move(made);
    return name;
  }
  std::string constant(double number) {
    const std::string name = fmt::format("number{}", made_.graph.constants.size());
    made_.graph.constants[name] = {
        .type = ElementType::kFloat, .shape = {1}, .floats = {static_cast<float>(number)}, .integers = {}};
    return name;
  }
  std::string whole_constant(std::vector<std::int64_t> numbers) {
    const std::string name = fmt::format("number{}", made_.graph.constants.size());
    made_.graph.constants[name] = {.type = ElementType::kInteger,
                                   .shape = {static_cast<std::int64_t>(numbers.size())},
                                   .floats = {},
                                   .integers = std::move(numbers)};
    return name;
  }

  // The text of a class: its file's up to the next one.
  [[nodiscard]] std::string class_source(const std::string& name) const {
    const std::size_t dot = std::min(name.rfind('.'), name.size());
    std::string path = name.substr(0, dot);
    std::ranges::replace(path, '.', '/');
    const auto source = archive_.sources.find(path + ".py");
    const std::string head = fmt::format("class {}(Module):\n", name.substr(std::min(dot + 1, name.size())));
    const std::size_t at = source == archive_.sources.end() ? std::string::npos : source->second.find(head);
    if (at == std::string::npos) refuse(fmt::format("no code of '{}'", name));
    return source->second.substr(at, source->second.find("\nclass ", at) - at);
  }

  // ---- modules

  // The result of the module's method for its arguments. `path`: its name within the file's module.
  Value call(int place, const std::string& path, const std::string& method, std::vector<Value> arguments, int depth) {
    const TorchNode& object = pickle_.nodes[place];
    if (object.kind != TorchKind::kObject) refuse(fmt::format("'{}', which is no module", path));
    if (depth > kDeepest) refuse(fmt::format("more than {} modules within one another", kDeepest));
    if (++modules_ > kMostModules) refuse(fmt::format("more than {} modules", kMostModules));
    const std::string name = plain_name(object.text);
    if (!name.starts_with(kTorchModules)) return run(object, path, method, std::move(arguments), depth);
    const std::string kind = name.substr(kTorchModules.size());
    if (kind == "rnn.LSTM" || kind == "rnn.GRU") return recurrent(object, path, kind == "rnn.LSTM", arguments);
    if (arguments.size() != 1 || arguments[0].kind != Value::Kind::kGraph)
      refuse(fmt::format("'{}' of something else than one tensor", path));
    const std::string& value = arguments[0].name;
    if (kind == "linear.Linear") return linear(object, path, value);
    for (const Activation& known : kActivations)
      if (kind == known.module) return activation(known, object, path, value, depth);
    if (kind == "activation.SiLU")
      return add_value(path, "Mul", {value, add_value(path + "/s", "Sigmoid", {value}).name});
    if (kind.starts_with("dropout.")) return arguments[0];
    if (kind == "normalization.LayerNorm") return layer_norm(object, path, value);
    if (kind == "batchnorm.BatchNorm1d") return batch_norm(object, path, value);
    if (kind == "container.Sequential") return run(object, path, method, std::move(arguments), depth);
    refuse(fmt::format("'{}' as '{}'", kind, path));
  }

  Value activation(const Activation& known, const TorchNode& object, const std::string& path, const std::string& value,
                   int depth) {
    if (known.parameter == nullptr) return add_value(path, known.op, {value});
    if (const std::optional<double> number = find_number(object, known.parameter))
      return shaped(path, known.op, value, *number);
    // A module that was traced keeps no number: its code calls the function with it.
    if (class_source(object.text).find("  def forward(") != std::string::npos)
      return run(object, path, "forward", {graph_value(value)}, depth);
    refuse(fmt::format("no line '{} : Final[float] = NUMBER' in the code of '{}'", known.parameter, path));
  }

  Value shaped(const std::string& name, std::string_view op, const std::string& value, double alpha) {
    Value made = add_value(name, op, {value});
    made_.graph.nodes.back().attributes["alpha"] = static_cast<float>(alpha);
    return made;
  }

  Value linear(const TorchNode& object, const std::string& path, const std::string& value) {
    const TorchNode& weight = member(object, path, "weight");
    if (weight.kind != TorchKind::kTensor || weight.sizes.size() != 2)
      refuse(fmt::format("'{}' without a matrix 'weight'", path));
    take_size(weight.sizes[1]);
    std::vector<std::string> inputs = {value, constant(path + ".weight", weight)};
    if (const TorchNode& bias = member(object, path, "bias"); bias.kind == TorchKind::kTensor)
      inputs.push_back(constant(path + ".bias", bias));
    const Value made = add_value(path, "Gemm", std::move(inputs));
    made_.graph.nodes.back().attributes["transB"] = std::int64_t{1};
    return made;
  }

  double number_of(const TorchNode& object, const std::string& path, const std::string& name) const {
    const std::optional<double> number = find_number(object, name);
    if (!number) refuse(fmt::format("'{}' without a number '{}'", path, name));
    return *number;
  }
  std::string vector_of(const TorchNode& object, const std::string& path, const std::string& name) {
    const TorchNode& tensor = member(object, path, name);
    if (tensor.kind != TorchKind::kTensor || tensor.sizes.size() != 1)
      refuse(fmt::format("'{}' without a vector '{}'", path, name));
    take_size(tensor.sizes[0]);
    return constant(path + "." + name, tensor);
  }

  Value layer_norm(const TorchNode& object, const std::string& path, const std::string& value) {
    std::vector<std::string> inputs = {value, vector_of(object, path, "weight")};
    if (const TorchNode* bias = find_member(object, "bias"); bias != nullptr && bias->kind == TorchKind::kTensor)
      inputs.push_back(vector_of(object, path, "bias"));
    const double epsilon = number_of(object, path, "eps");
    const Value made = add_value(path, "LayerNormalization", std::move(inputs));
    made_.graph.nodes.back().attributes["epsilon"] = static_cast<float>(epsilon);
    return made;
  }

  // Batch normalisation as it is evaluated, not trained.
  Value batch_norm(const TorchNode& object, const std::string& path, const std::string& value) {
    const std::string mean = vector_of(object, path, "running_mean");
    const std::string shifted = add_value(path + "/shift", "Sub", {value, mean}).name;
    const std::string variance = vector_of(object, path, "running_var");
    const std::string wide = add_value(path + "/eps", "Add", {variance, constant(number_of(object, path, "eps"))}).name;
    const std::string deviation = add_value(path + "/sqrt", "Sqrt", {wide}).name;
    Value made = add_value(path + "/scale", "Div", {shifted, deviation});
    const TorchNode* const weight = find_member(object, "weight");
    if (weight == nullptr || weight->kind != TorchKind::kTensor) return made;
    made = add_value(path + "/weight", "Mul", {made.name, vector_of(object, path, "weight")});
    return add_value(path + "/bias", "Add", {made.name, vector_of(object, path, "bias")});
  }

  // ---- recurrent layers

  // Rows of the gates in ONNX's order from PyTorch's: i f g o -> i o f g; r z n -> z r n.
  static std::vector<float> in_onnx_order(const std::vector<float>& rows, bool lstm) {
    const std::vector<std::size_t> order =
        lstm ? std::vector<std::size_t>{0, 3, 1, 2} : std::vector<std::size_t>{1, 0, 2};
    const std::size_t block = rows.size() / order.size();
    std::vector<float> out;
    for (const std::size_t gate : order)
      out.insert(out.end(), rows.begin() + static_cast<std::ptrdiff_t>(gate * block),
                 rows.begin() + static_cast<std::ptrdiff_t>((gate + 1) * block));
    return out;
  }

  std::string gate_constant(const std::string& name, std::vector<float> values, Shape shape) {
    made_.graph.constants[name] = {
        .type = ElementType::kFloat, .shape = std::move(shape), .floats = std::move(values), .integers = {}};
    return name;
  }

  struct RecurrentWeights {
    std::string W, R, B;
    std::int64_t hidden = 0;
  };

  RecurrentWeights weights(const TorchNode& object, const std::string& path, bool lstm, int layer) {
    const std::int64_t gates = lstm ? 4 : 3;
    const auto matrix = [&](const char* what) -> const TorchNode& {
      const TorchNode& tensor = member(object, path, fmt::format("{}_l{}", what, layer));
      if (tensor.kind != TorchKind::kTensor) refuse(fmt::format("'{}' without a tensor '{}_l{}'", path, what, layer));
      return tensor;
    };
    const TorchNode &W = matrix("weight_ih"), &R = matrix("weight_hh");
    if (W.sizes.size() != 2 || R.sizes.size() != 2 || R.sizes[0] != gates * R.sizes[1] || W.sizes[0] != R.sizes[0])
      refuse(fmt::format("matrices of '{}' whose sizes do not fit", path));
    if (layer == 0) take_size(W.sizes[1]);
    const std::string name = fmt::format("{}.{}", path, layer);
    std::vector<float> bias = in_onnx_order(numbers(name, matrix("bias_ih")), lstm);
    const std::vector<float> other = in_onnx_order(numbers(name, matrix("bias_hh")), lstm);
    bias.insert(bias.end(), other.begin(), other.end());
    return {gate_constant(name + ".W", in_onnx_order(numbers(name, W), lstm), {1, W.sizes[0], W.sizes[1]}),
            gate_constant(name + ".R", in_onnx_order(numbers(name, R), lstm), {1, R.sizes[0], R.sizes[1]}),
            gate_constant(name + ".B", std::move(bias), {1, 2 * gates * R.sizes[1]}), R.sizes[1]};
  }

  // The name of the part `layer` of a state (layers, 1, hidden).
  std::string state_of_layer(const std::string& state, int layer, int layers) {
    if (layers == 1) return state;
    return add_value(fmt::format("{}/{}", state, layer), "Slice",
                     {state, whole_constant({layer}), whole_constant({layer + 1}), whole_constant({0})})
        .name;
  }

  std::string joined(const std::string& path, const std::vector<std::string>& states) {
    if (states.size() == 1) return states[0];
    const std::string name = add_value(path + "/states", "Concat", states).name;
    made_.graph.nodes.back().attributes["axis"] = std::int64_t{0};
    return name;
  }

  // forward(x, h) or forward(x, (h, c)): (output, h) or (output, (h, c)).
  Value recurrent(const TorchNode& object, const std::string& path, bool lstm, const std::vector<Value>& arguments) {
    const bool states = arguments.size() == 2 && (lstm ? arguments[1].parts.size() == 2 : arguments[1].parts.empty());
    if (!states || arguments[0].kind != Value::Kind::kGraph) refuse(fmt::format("'{}' without its memory", path));
    for (const char* key : {"bidirectional", "proj_size"})
      if (find_number(object, key).value_or(0.0) != 0.0) refuse(fmt::format("'{}' with '{}'", path, key));
    const int layers = static_cast<int>(find_number(object, "num_layers").value_or(1.0));
    std::string value = arguments[0].name;
    std::vector<std::string> h, c;
    for (int layer = 0; layer < layers; ++layer) {
      const RecurrentWeights w = weights(object, path, lstm, layer);
      const std::string x =
          add_value(fmt::format("{}/x{}", path, layer), "Unsqueeze", {value, whole_constant({0})}).name;
      std::vector<std::string> inputs = {x, w.W, w.R, w.B, ""};
      inputs.push_back(
          state_of_layer(memory(lstm ? arguments[1].parts[0] : arguments[1], path, layers, w.hidden), layer, layers));
      if (lstm) inputs.push_back(state_of_layer(memory(arguments[1].parts[1], path, layers, w.hidden), layer, layers));
      const std::string name = fmt::format("{}/{}", path, layer);
      OnnxNode& node = add(name, lstm ? "LSTM" : "GRU", std::move(inputs), "");
      node.outputs = {name + "/steps", name + "/h"};
      if (lstm) node.outputs.push_back(name + "/c");
      node.attributes["hidden_size"] = w.hidden;
      if (!lstm) node.attributes["linear_before_reset"] = std::int64_t{1};
      h.push_back(name + "/h");
      c.push_back(name + "/c");
      value = add_value(name + "/y", "Squeeze", {h.back(), whole_constant({0})}).name;
    }
    const Value after = graph_value(joined(path + "/h", h));
    Value memory_after = after;
    if (lstm) memory_after = {.kind = Value::Kind::kTuple, .parts = {after, graph_value(joined(path + "/c", c))}};
    return {.kind = Value::Kind::kTuple, .parts = {graph_value(value), memory_after}};
  }

  // The graph's input that a state is.
  std::string memory(const Value& value, const std::string& path, std::int64_t layers, std::int64_t hidden) {
    if (value.kind != Value::Kind::kGraph || value.member.empty()) refuse(fmt::format("'{}' without its memory", path));
    const auto known = std::ranges::find(made_.states, value.member, &TorchState::input);
    if (known != made_.states.end()) return known->input;
    made_.states.push_back({value.member, ""});
    made_.graph.inputs.push_back({value.member, {layers, 1, hidden}});
    return value.member;
  }

  // Members of the file's module that its code writes to.
  void find_states() {
    const TorchNode& root = pickle_.nodes[pickle_.root];
    if (root.kind != TorchKind::kObject) return;
    const std::string source = class_source(root.text);
    for (const auto& [name, place] : root.members)
      if (pickle_.nodes[place].kind == TorchKind::kTensor && writes_to(source, name)) states_.insert(name);
  }

  // "h0 = self.hidden" with "torch.copy_(torch.slice(h0" or "torch.copy_(h0", or "self.hidden = ".
  static bool writes_to(const std::string& source, const std::string& name) {
    const std::string read = fmt::format(" = self.{}\n", name);
    if (source.find(fmt::format("    self.{} = ", name)) != std::string::npos) return true;
    for (std::size_t at = source.find(read); at != std::string::npos; at = source.find(read, at + 1)) {
      const std::size_t begin = source.rfind(' ', at - 1) + 1;
      const std::string variable = source.substr(begin, at - begin);
      for (const char* end : {")", ","})
        for (const char* call : {"torch.copy_(torch.slice({}{}", "torch.copy_({}{}"})
          if (source.find(fmt::format(fmt::runtime(call), variable, end)) != std::string::npos) return true;
    }
    return false;
  }

  // ---- code

  Value run(const TorchNode& object, const std::string& path, const std::string& method, std::vector<Value> arguments,
            int depth) {
    std::optional<TorchFunction> function;
    try {
      function = torch_method(class_source(object.text), method);
    } catch (const TorchCodeFault& fault) {
      refuse_line(fault.line, path);
    }
    if (!function || function->arguments.size() != arguments.size())
      refuse(
          fmt::format("no {} of {} in '{}'", method, arguments.size() == 1 ? "one tensor" : "these arguments", path));
    Frame frame{.object = object, .path = path, .depth = depth, .values = {}};
    for (std::size_t i = 0; i < arguments.size(); ++i) frame.values[function->arguments[i]] = std::move(arguments[i]);
    const std::optional<Value> made = block(frame, function->body);
    if (!made) refuse(fmt::format("no return in the code of '{}'", path));
    return *made;
  }

  std::optional<Value> block(Frame& frame, const std::vector<TorchStatement>& statements) {
    for (const TorchStatement& statement : statements) {
      switch (statement.kind) {
        case TorchStatement::Kind::kPass:
          break;
        case TorchStatement::Kind::kReturn:
          return evaluate(frame, statement.value, statement.line);
        case TorchStatement::Kind::kIf: {
          const Value condition = evaluate(frame, statement.value, statement.line);
          if (condition.kind != Value::Kind::kNumber) refuse_line(statement.line, frame.path);
          if (auto made = block(frame, condition.number != 0.0 ? statement.block : statement.other)) return made;
          break;
        }
        case TorchStatement::Kind::kAssign:
          assign(frame, statement);
      }
    }
    return std::nullopt;
  }

  void assign(Frame& frame, const TorchStatement& statement) {
    Value value = evaluate(frame, statement.value, statement.line);
    if (statement.targets.size() > 1) {
      if (value.parts.size() != statement.targets.size()) refuse_line(statement.line, frame.path);
      for (std::size_t i = 0; i < statement.targets.size(); ++i) frame.values[statement.targets[i]] = value.parts[i];
      return;
    }
    if (statement.targets.empty()) return;
    const std::string& target = statement.targets.front();
    if (target.starts_with("self.")) {
      if (!states_.contains(target.substr(5)) || value.kind != Value::Kind::kGraph)
        refuse_line(statement.line, frame.path);
      updates_[target.substr(5)] = value.name;
    } else {
      frame.values[target] = std::move(value);
    }
  }

  Value evaluate(Frame& frame, const TorchExpression& code, const std::string& line) {
    using Kind = TorchExpression::Kind;
    switch (code.kind) {
      case Kind::kNumber:
        return {.kind = Value::Kind::kNumber, .number = code.number};
      case Kind::kText:
        return {};
      case Kind::kName:
        return named(frame, code.name, line);
      case Kind::kTuple:
        return {.kind = Value::Kind::kTuple, .parts = all(frame, code, 0, line)};
      case Kind::kIndex: {
        const std::vector<Value> parts = all(frame, code, 0, line);
        const auto index = static_cast<std::size_t>(parts[1].number);
        if (parts[1].kind != Value::Kind::kNumber || index >= parts[0].parts.size()) refuse_line(line, frame.path);
        return parts[0].parts[index];
      }
      case Kind::kMethod: {
        const Value object = evaluate(frame, code.parts[0], line);
        if (object.kind != Value::Kind::kStored) refuse_line(line, frame.path);
        return call(object.node, object.path, code.name, all(frame, code, 1, line), frame.depth + 1);
      }
      case Kind::kCall:
        return function(frame, code, line);
    }
    refuse_line(line, frame.path);
  }

  std::vector<Value> all(Frame& frame, const TorchExpression& code, std::size_t from, const std::string& line) {
    std::vector<Value> values;
    for (std::size_t i = from; i < code.parts.size(); ++i) values.push_back(evaluate(frame, code.parts[i], line));
    return values;
  }

  Value named(Frame& frame, const std::string& name, const std::string& line) {
    if (const auto known = frame.values.find(name); known != frame.values.end()) return known->second;
    if (name == "None") return {};
    if (name == "True" || name == "False") return {.kind = Value::Kind::kNumber, .number = name == "True" ? 1.0 : 0.0};
    if (!name.starts_with("self.")) refuse_line(line, frame.path);
    return member_value(frame, name.substr(5), line);
  }

  Value member_value(const Frame& frame, const std::string& name, const std::string& line) {
    const auto found = frame.object.members.find(name);
    if (found == frame.object.members.end()) {
      if (const std::optional<double> number = find_number(frame.object, name))
        return {.kind = Value::Kind::kNumber, .number = *number};
      refuse(fmt::format("no member '{}' in '{}' (the line '{}')", name, frame.path, excerpt(line)));
    }
    const TorchNode& node = pickle_.nodes[found->second];
    if (node.kind == TorchKind::kNone) return {};
    if (node.kind == TorchKind::kNumber || node.kind == TorchKind::kReal)
      return {.kind = Value::Kind::kNumber, .number = find_number(frame.object, name).value_or(0.0)};
    if (frame.depth == 0 && states_.contains(name)) return {.kind = Value::Kind::kGraph, .name = name, .member = name};
    const std::string path = frame.depth == 0 ? name : frame.path + "." + name;
    return {.kind = Value::Kind::kStored, .node = found->second, .path = path};
  }

  // The name of the graph's value that an argument is; a number and a tensor of the file become constants.
  std::string operand(const Value& value, const std::string& line, const std::string& path) {
    if (value.kind == Value::Kind::kGraph) return value.name;
    if (value.kind == Value::Kind::kNumber) return constant(value.number);
    if (value.kind != Value::Kind::kStored || pickle_.nodes[value.node].kind != TorchKind::kTensor)
      refuse_line(line, path);
    const TorchNode& tensor = pickle_.nodes[value.node];
    if (!tensor.sizes.empty() && tensor.sizes.back() > 1) take_size(tensor.sizes.back());
    return constant(value.path, tensor);
  }

  Value function(Frame& frame, const TorchExpression& code, const std::string& line) {
    const std::string& name = code.name;
    if (name == "getattr" && code.parts.size() == 2 && code.parts[0].name == "self")
      return member_value(frame, code.parts[1].name, line);
    const std::vector<Value> values = all_positional(frame, code, line);
    if (values.empty()) refuse_line(line, frame.path);
    if (std::ranges::find(kUnchanged, name) != std::end(kUnchanged)) return values[0];
    if (name == "annotate" || name == "unchecked_cast") return values.back();
    if (name == "torch.copy_") return copied(values, line, frame.path);
    if (name == "torch.__not__" && values[0].kind == Value::Kind::kNumber)
      return {.kind = Value::Kind::kNumber, .number = values[0].number == 0.0 ? 1.0 : 0.0};
    if (name == "torch.__is__" || name == "torch.__isnot__") {
      const bool is_none = values[0].kind == Value::Kind::kNone;
      return {.kind = Value::Kind::kNumber, .number = is_none == (name == "torch.__is__") ? 1.0 : 0.0};
    }
    if (name == "torch.clamp" || name == "torch.clip") return clamped(values, line, frame.path);
    for (const Function& known : kShapedFunctions)
      if (name == known.name && values.size() == 2 && values[0].kind == Value::Kind::kGraph &&
          values[1].kind == Value::Kind::kNumber)
        return shaped(fmt::format("{}/{}", frame.path, made_.graph.nodes.size()), known.op, values[0].name,
                      values[1].number);
    for (const Function& known : kFunctions)
      if (name == known.name && known.arguments == static_cast<int>(values.size())) {
        std::vector<std::string> inputs;
        for (const Value& value : values) inputs.push_back(operand(value, line, frame.path));
        return add_value(fmt::format("{}/{}", frame.path, made_.graph.nodes.size()), known.op, std::move(inputs));
      }
    refuse_line(line, frame.path);
  }

  // `dtype=..., device=...` are not looked at; other named arguments mean another function.
  std::vector<Value> all_positional(Frame& frame, const TorchExpression& code, const std::string& line) {
    std::vector<Value> values;
    for (std::size_t i = 0; i < code.parts.size(); ++i) {
      if (code.keys[i] == "dtype" || code.keys[i] == "device") continue;
      if (!code.keys[i].empty()) refuse_line(line, frame.path);
      const bool type = (code.name == "annotate" || code.name == "unchecked_cast") && i == 0;
      values.push_back(type ? Value{} : evaluate(frame, code.parts[i], line));
    }
    return values;
  }

  Value copied(const std::vector<Value>& values, const std::string& line, const std::string& path) {
    if (values.size() < 2 || values[0].member.empty() || values[1].kind != Value::Kind::kGraph) refuse_line(line, path);
    updates_[values[0].member] = values[1].name;
    return values[0];
  }

  Value clamped(const std::vector<Value>& values, const std::string& line, const std::string& path) {
    if (values.size() != 3) refuse_line(line, path);
    std::vector<std::string> inputs = {operand(values[0], line, path)};
    for (std::size_t i = 1; i < 3; ++i) {
      if (values[i].kind != Value::Kind::kNone && values[i].kind != Value::Kind::kNumber) refuse_line(line, path);
      inputs.push_back(values[i].kind == Value::Kind::kNone ? "" : scalar(values[i].number));
    }
    return add_value(fmt::format("{}/{}", path, made_.graph.nodes.size()), "Clip", std::move(inputs));
  }
  std::string scalar(double number) {
    const std::string name = constant(number);
    made_.graph.constants[name].shape.clear();
    return name;
  }

  const TorchArchive& archive_;
  TorchPickle pickle_;
  TorchGraph made_;
  std::set<std::string> states_;                // members of the file's module that its code writes to
  std::map<std::string, std::string> updates_;  // state -> the graph's value that follows it
  std::int64_t inputs_ = 0, numbers_ = 0;       // of the input; of all constants
  int modules_ = 0;
};

}  // namespace

TorchGraph torch_graph(const TorchArchive& archive) { return GraphReader(archive).read(); }

}  // namespace duet
