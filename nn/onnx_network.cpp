#include "duet/nn/onnx_network.h"

#include <fmt/format.h>

#include <algorithm>

#include "duet/core/require.h"
#include "duet/nn/onnx_plan.h"

namespace duet {
namespace {

class OnnxNetwork final : public Network {
 public:
  explicit OnnxNetwork(const OnnxGraph& graph) : plan_(plan_onnx(graph)) {
    for (const OnnxPort& port : graph.inputs) {
      OnnxValue& value = plan_->values.at(port.name);
      inputs_.push_back({port.name, static_cast<int>(value.count())});
      to_.push_back(value.data);
    }
    for (const OnnxPort& port : graph.outputs) add_output(graph, port);
    plan_->values.clear();  // the steps hold the addresses
  }

  [[nodiscard]] std::span<const Port> inputs() const override { return inputs_; }
  [[nodiscard]] std::span<const Port> outputs() const override { return outputs_; }

  void run(std::span<const std::span<const float>> inputs, std::span<const std::span<float>> outputs) override {
    for (std::size_t i = 0; i < to_.size(); ++i) std::copy_n(inputs[i].data(), inputs_[i].size, to_[i]);
    for (const OnnxStep& step : plan_->steps) step();
    for (std::size_t i = 0; i < from_.size(); ++i) std::copy_n(from_[i], outputs_[i].size, outputs[i].data());
  }

 private:
  void add_output(const OnnxGraph& graph, const OnnxPort& port) {
    const OnnxValue& value = plan_->values.at(port.name);
    check_shape(graph, port, value.shape);
    if (value.data == nullptr)
      throw InputError(fmt::format("'{}': output '{}': expected what the network gives, found fixed whole numbers",
                                   graph.file, port.name));
    outputs_.push_back({port.name, static_cast<int>(value.count())});
    from_.push_back(value.data);
  }

  // The shape that the file states for an output, where it states one, must be the one that its nodes give.
  static void check_shape(const OnnxGraph& graph, const OnnxPort& port, const Shape& found) {
    if (port.shape.empty()) return;
    bool fits = port.shape.size() == found.size();
    for (std::size_t d = 0; fits && d < found.size(); ++d) fits = port.shape[d] < 0 || port.shape[d] == found[d];
    if (!fits)
      throw InputError(fmt::format("'{}': output '{}': expected shape {} (-1: any), found {}", graph.file, port.name,
                                   shape_text(port.shape), shape_text(found)));
  }

  std::unique_ptr<OnnxPlan> plan_;
  std::vector<Port> inputs_, outputs_;
  std::vector<float*> to_;
  std::vector<const float*> from_;
};

}  // namespace

std::unique_ptr<Network> onnx_network(const OnnxGraph& graph) { return std::make_unique<OnnxNetwork>(graph); }

std::unique_ptr<Network> onnx_network(std::string_view bytes, const std::string& file, const std::string& folder) {
  return onnx_network(parse_onnx(bytes, file, folder));
}

}  // namespace duet
