// TorchScript of two kinds without libtorch: what legged_gym's PolicyExporterLSTM writes (unitree_rl_gym's policies: an
// LSTM of one layer, then linear layers with ELU between them; its memory lives in the module), and linear layers and
// activations one after another (nn/torch_mlp.h). The kind is told by the archive's own code; any other is refused.
#pragma once

#include <memory>
#include <string_view>

#include "duet/nn/network.h"

namespace duet {

// One input "x", one output "action". An LSTM is stateful: run() moves its memory on, reset() zeroes it. Throws
// InputError naming file, place, expected and found.
std::unique_ptr<Network> torch_script_network(std::string_view bytes, const std::string& file);

}  // namespace duet
