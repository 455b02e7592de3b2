// TorchScript without libtorch: what legged_gym's PolicyExporterLSTM writes (unitree_rl_gym's policies: an LSTM of one
// layer, then linear layers with ELU between them; its memory lives in the module), and policies of linear, recurrent
// and normalising layers by their own code (nn/torch_mlp.h). Any other is refused.
#pragma once

#include <functional>
#include <memory>
#include <string_view>

#include "duet/nn/network.h"

namespace duet {

// Makes networks, each of one input "x", one output "action". A recurrent one is stateful: run() moves its memory on,
// reset() zeroes it. Throws InputError naming file, place, expected and found.
std::function<std::unique_ptr<Network>()> torch_script_maker(std::string_view bytes, const std::string& file);
std::unique_ptr<Network> torch_script_network(std::string_view bytes, const std::string& file);

}  // namespace duet
