// An ONNX model as a Network, evaluated by our own plan.
#pragma once

#include <memory>
#include <string_view>

#include "nn/network.h"

namespace duet {

// Throws InputError (see load_network).
std::unique_ptr<Network> onnx_network(std::string_view bytes, const std::string& file);

}  // namespace duet
