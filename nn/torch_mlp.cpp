#include "duet/nn/torch_mlp.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "duet/core/number.h"
#include "duet/core/text.h"
#include "duet/nn/torch_pickle.h"

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

// What stands between the two in a text that begins and ends so.
std::optional<std::string> between(std::string_view text, std::string_view begin, std::string_view end) {
  if (text.size() < begin.size() + end.size() || !text.starts_with(begin) || !text.ends_with(end)) return std::nullopt;
  return std::string(text.substr(begin.size(), text.size() - begin.size() - end.size()));
}

// Without the numbers by which TorchScript tells classes of one name apart: "linear.___torch_mangle_0.Linear".
std::string plain_name(std::string name) {
  for (std::size_t at = name.find("___torch_mangle_"); at != std::string::npos; at = name.find("___torch_mangle_", at))
    name.erase(at, name.find('.', at) - at + 1);
  return name;
}

class ChainReader {
 public:
  explicit ChainReader(const TorchArchive& archive) : archive_(archive), pickle_(read_torch_pickle(archive)) {
    graph_.file = archive.file;
    graph_.opset = kNewestOpset;
  }

  OnnxGraph read() {
    const std::string last = module(pickle_.root, "module", "x", 0);
    if (inputs_ == 0) refuse("none");
    add("action", "Identity", {last}, "action");
    graph_.inputs = {{"x", {1, inputs_}}};
    graph_.outputs = {{"action", {}}};
    return std::move(graph_);
  }

 private:
  [[noreturn]] void refuse(const std::string& found) const {
    archive_.refuse(
        fmt::format("expected a PolicyExporterLSTM, or linear layers and activations one after another, found {} "
                    "(TorchScript of another kind; needs libtorch)",
                    shown(found, kShownSentence)));
  }

  OnnxNode& add(const std::string& name, std::string_view op, std::vector<std::string> inputs, std::string output) {
    graph_.nodes.push_back({.name = name,
                            .op = std::string(op),
                            .inputs = std::move(inputs),
                            .outputs = {std::move(output)},
                            .attributes = {}});
    return graph_.nodes.back();
  }

  std::string next_value() { return fmt::format("value{}", graph_.nodes.size()); }

  // What the module makes of `value`. `path`: its name within the file's module.
  std::string module(int place, const std::string& path, const std::string& value, int depth) {
    const TorchNode& object = pickle_.nodes[place];
    if (object.kind != TorchKind::kObject) refuse(fmt::format("'{}', which is no module", path));
    if (depth > kDeepest) refuse(fmt::format("more than {} modules within one another", kDeepest));
    if (++modules_ > kMostModules) refuse(fmt::format("more than {} modules", kMostModules));
    const std::string name = plain_name(object.text);
    if (!name.starts_with(kTorchModules)) return container(object, path, value, depth);
    const std::string kind = name.substr(kTorchModules.size());
    if (kind == "linear.Linear") return linear(object, path, value);
    for (const Activation& known : kActivations)
      if (kind == known.module) return activation(known, object, path, value);
    if (kind == "container.Sequential") return container(object, path, value, depth);
    refuse(fmt::format("'{}' as '{}'", kind, path));
  }

  std::string activation(const Activation& known, const TorchNode& object, const std::string& path,
                         const std::string& value) {
    std::string output = next_value();
    OnnxNode& node = add(path, known.op, {value}, output);
    if (known.parameter == nullptr) return output;
    const std::string line = fmt::format("  {} : Final[float] = ", known.parameter);
    const std::string source = class_source(object.text);
    const std::size_t at = source.find(line);
    const std::size_t begin = at + line.size();
    const auto number = at == std::string::npos
                            ? std::nullopt
                            : parse_number(std::string_view(source).substr(begin, source.find('\n', begin) - begin));
    if (!number) refuse(fmt::format("no line '{}NUMBER' in the code of '{}'", line.substr(2), path));
    node.attributes["alpha"] = static_cast<float>(*number);
    return output;
  }

  std::string linear(const TorchNode& object, const std::string& path, const std::string& value) {
    const TorchNode& weight = member(object, path, "weight");
    if (weight.kind != TorchKind::kTensor || weight.sizes.size() != 2)
      refuse(fmt::format("'{}' without a matrix 'weight'", path));
    if (value == "x" && inputs_ == 0) inputs_ = weight.sizes[1];
    std::string output = next_value();
    std::vector<std::string> inputs = {value, constant(path + ".weight", weight)};
    if (const TorchNode& bias = member(object, path, "bias"); bias.kind == TorchKind::kTensor)
      inputs.push_back(constant(path + ".bias", bias));
    add(path, "Gemm", std::move(inputs), output).attributes["transB"] = std::int64_t{1};
    return output;
  }

  const TorchNode& member(const TorchNode& object, const std::string& path, const std::string& name) const {
    const auto found = object.members.find(name);
    if (found == object.members.end()) refuse(fmt::format("'{}' without a member '{}'", path, name));
    return pickle_.nodes[found->second];
  }

  // A vector's or matrix's numbers out of its storage, by its strides.
  std::string constant(const std::string& name, const TorchNode& tensor) {
    if (tensor.text != "torch.FloatStorage") refuse(fmt::format("numbers of '{}' that are not float", name));
    const auto storage = archive_.tensors.find(tensor.storage);
    if (storage == archive_.tensors.end()) refuse(fmt::format("no 'data/{}' for '{}'", tensor.storage, name));
    const std::vector<float>& held = storage->second;
    if (!fits(tensor, static_cast<std::int64_t>(held.size())))
      refuse(fmt::format("'{}', whose sizes do not fit the {} numbers of its storage", name, held.size()));
    const bool matrix = tensor.sizes.size() == 2;
    const std::int64_t rows = tensor.sizes[0], columns = matrix ? tensor.sizes[1] : 1;
    if ((numbers_ += rows * columns) > kMostNumbers) refuse(fmt::format("more than {} numbers", kMostNumbers));
    OnnxTensor made{.type = ElementType::kFloat, .shape = tensor.sizes, .floats = {}, .integers = {}};
    for (std::int64_t r = 0; r < rows; ++r)
      for (std::int64_t c = 0; c < columns; ++c)
        made.floats.push_back(held[static_cast<std::size_t>(tensor.number + r * tensor.strides[0] +
                                                            (matrix ? c * tensor.strides[1] : 0))]);
    graph_.constants[name] = std::move(made);
    return name;
  }

  // Whether every number of a vector or matrix is one of the `held` of its storage, and each but once.
  static bool fits(const TorchNode& tensor, std::int64_t held) {
    const std::size_t rank = tensor.sizes.size();
    if (rank < 1 || rank > 2 || rank != tensor.strides.size() || tensor.number < 0) return false;
    std::int64_t count = 1, last = tensor.number;
    for (std::size_t d = 0; d < rank; ++d) {
      const std::int64_t size = tensor.sizes[d], stride = tensor.strides[d];
      if (size < 1 || size > held / count || stride < 1 || stride > held) return false;
      count *= size;
      last += (size - 1) * stride;
    }
    return last < held;
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

  // A module whose code hands its one tensor through its members, one after another.
  std::string container(const TorchNode& object, const std::string& path, const std::string& value, int depth) {
    constexpr std::string_view kHead = "  def forward(self: ", kEnd = ") -> Tensor:\n";
    const std::string source = class_source(object.text);
    const std::size_t head = source.find(kHead);
    const std::size_t end = source.find(kEnd, std::min(head, source.size()));
    if (head == std::string::npos || end == std::string::npos)
      refuse(fmt::format("no forward of one tensor in '{}'", path));
    const std::string arguments = source.substr(head + kHead.size(), end - head - kHead.size());
    const std::size_t name = arguments.find_first_not_of(", \n", arguments.find(','));
    const std::optional<std::string> argument =
        name == std::string::npos ? std::nullopt : between(std::string_view(arguments).substr(name), "", ": Tensor");
    if (!argument || argument->find(',') != std::string::npos)
      refuse(fmt::format("no forward of one tensor in '{}'", path));
    Scope scope{.object = object, .path = path, .depth = depth, .values = {{*argument, value}}, .members = {}};
    return body(scope, std::string_view(source).substr(end + kEnd.size()));
  }

  struct Scope {
    const TorchNode& object;
    std::string path;
    int depth;
    std::map<std::string, std::string> values, members;  // of the code's variables: what they hold, whom they name
  };

  std::string body(Scope& scope, std::string_view code) {
    while (code.starts_with("    ")) {
      const std::string_view line = code.substr(4, code.find('\n') - 4);
      code.remove_prefix(std::min(code.size(), code.find('\n') + 1));
      if (line.starts_with("return ")) return result(scope, line.substr(7), line);
      const std::size_t equals = line.find(" = ");
      if (equals == std::string_view::npos) refuse_line(scope, line);
      const std::string variable(line.substr(0, equals));
      const std::string_view right = line.substr(equals + 3);
      if (const auto name = named_member(right))
        scope.members[variable] = *name;
      else
        scope.values[variable] = result(scope, right, line);
    }
    refuse(fmt::format("no return in the code of '{}'", scope.path));
  }

  [[noreturn]] void refuse_line(const Scope& scope, std::string_view line) const {
    refuse(fmt::format("the line '{}' in the code of '{}'", shown(line), scope.path));
  }

  // getattr(self, "0") and self.actor
  static std::optional<std::string> named_member(std::string_view text) {
    if (auto name = between(text, "getattr(self, \"", "\")")) return name;
    auto name = between(text, "self.", "");
    return name && name->find_first_of(".()") == std::string::npos ? name : std::nullopt;
  }

  // (module).forward(value, ), or a variable.
  std::string result(Scope& scope, std::string_view text, std::string_view line) {
    constexpr std::string_view kCall = ").forward(";
    if (const auto known = scope.values.find(std::string(text)); known != scope.values.end()) return known->second;
    const std::size_t call = text.find(kCall);
    if (!text.starts_with('(') || call == std::string_view::npos || !text.ends_with(", )")) refuse_line(scope, line);
    const std::string callee(text.substr(1, call - 1));
    const auto argument = scope.values.find(*between(text.substr(call), kCall, ", )"));
    const auto variable = scope.members.find(callee);
    const auto name = variable != scope.members.end() ? variable->second : named_member(callee);
    if (argument == scope.values.end() || !name) refuse_line(scope, line);
    const auto found = scope.object.members.find(*name);
    if (found == scope.object.members.end()) refuse(fmt::format("no member '{}' in '{}'", *name, scope.path));
    const std::string path = scope.depth == 0 ? *name : scope.path + "." + *name;
    return module(found->second, path, argument->second, scope.depth + 1);
  }

  const TorchArchive& archive_;
  TorchPickle pickle_;
  OnnxGraph graph_;
  std::int64_t inputs_ = 0, numbers_ = 0;  // of the input; of all constants
  int modules_ = 0;
};

}  // namespace

OnnxGraph torch_mlp_graph(const TorchArchive& archive) { return ChainReader(archive).read(); }

}  // namespace duet
