// TorchScript modules that are a chain of linear layers and activations (torch.fx's GraphModule, nn.Sequential, and
// modules of such): what their own code says becomes a graph of ONNX operators. Internal to nn/.
#pragma once

#include "duet/nn/onnx_model.h"
#include "duet/nn/torch_archive.h"

namespace duet {

// One input "x", one output "action". Throws as TorchArchive::refuse for a module, a line of its code or a tensor that
// is none of these.
OnnxGraph torch_mlp_graph(const TorchArchive& archive);

}  // namespace duet
