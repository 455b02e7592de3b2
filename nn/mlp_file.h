// Multilayer perceptrons among the tensors of a file: `<prefix>.<layer>.weight` (out, in) and `<prefix>.<layer>.bias`.
#pragma once

#include <string>

#include "duet/nn/mlp.h"
#include "duet/nn/safetensors.h"

namespace duet {

void add_mlp(SafeTensors& tensors, const std::string& prefix, const Mlp& mlp);

// Throws InputError (file, tensor, expected, found): no layer 0, a missing bias, shapes that do not fit one another,
// weights that are not finite.
Mlp read_mlp(const SafeTensors& tensors, const std::string& prefix, const std::string& file);

}  // namespace duet
