// An ONNX model as a Network, evaluated by our own plan.
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "duet/nn/network.h"
#include "duet/nn/onnx_model.h"

namespace duet {

// `folder`: of files that the model keeps numbers in; "": it may have none. Throws InputError (see load_network).
std::unique_ptr<Network> onnx_network(std::string_view bytes, const std::string& file, const std::string& folder = "");
// A network from a graph that another format was read into.
std::unique_ptr<Network> onnx_network(const OnnxGraph& graph);

}  // namespace duet
