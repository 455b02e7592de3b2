// Small ONNX files for tests, written through protobuf.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "duet/nn/network.h"
#include "duet/nn/onnx/onnx_model.h"

namespace onnx {
class ModelProto;
}

namespace duet::test {

using Attributes = std::map<std::string, OnnxAttribute>;

class OnnxWriter {
 public:
  explicit OnnxWriter(int opset = 13);
  ~OnnxWriter();

  OnnxWriter& input(const std::string& name, const Shape& shape);  // -1: left open; float
  OnnxWriter& output(const std::string& name);                     // of no stated shape
  OnnxWriter& output(const std::string& name, const Shape& shape);
  OnnxWriter& constant(const std::string& name, const Shape& shape, const std::vector<float>& values);
  OnnxWriter& whole(const std::string& name, const std::vector<std::int64_t>& values);  // one dimension, int64
  OnnxWriter& tensor(const std::string& name, const OnnxTensor& tensor);
  OnnxWriter& node(const std::string& op, const std::vector<std::string>& inputs,
                   const std::vector<std::string>& outputs, const Attributes& attributes = {},
                   const std::string& domain = "");

  [[nodiscard]] onnx::ModelProto& model() { return *model_; }  // for what is deliberately wrong
  [[nodiscard]] std::string bytes() const;
  [[nodiscard]] std::unique_ptr<Network> network() const;
  // The message of the InputError that loading gives.
  [[nodiscard]] std::string refusal() const;

 private:
  std::unique_ptr<onnx::ModelProto> model_;
};

struct Operand {
  Shape shape;
  std::vector<float> values;
};

// Numbers that differ, of both signs, below `scale`; another stream for another seed.
Operand operand(const Shape& shape, int seed = 0, double scale = 1.0);

// The result of one node on its operands, each of them an input of the network or, where its bit in `constants` is set,
// a constant of the file.
std::vector<float> through(const std::string& op, const std::vector<Operand>& operands, const Attributes& attributes,
                           int opset, unsigned constants);

// The node gives `expected` within 1e-6 of its size whichever operands are constants, in each of these operator sets.
void expect_node(const std::string& op, const std::vector<Operand>& operands, const std::vector<double>& expected,
                 const Attributes& attributes = {}, const std::vector<int>& opsets = {11, 13, 17, 18});

}  // namespace duet::test
