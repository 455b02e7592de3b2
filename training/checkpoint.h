// Parts that checkpoints of all trainings share: normalisers and Adam's moments among the tensors of a file. Reading
// throws InputError naming the file, what is missing or what has another size.
#pragma once

#include <string>

#include "duet/nn/stored_values.h"
#include "duet/training/batch_mlp.h"
#include "duet/training/normaliser.h"

namespace duet {

void add_normaliser(SafeTensors& tensors, const std::string& prefix, const Normaliser& normaliser);
Normaliser normaliser_of(const SafeTensors& tensors, const std::string& prefix, int size, const std::string& file);

// `parameters`: what is being learnt, in order; the moments have their sizes.
void add_adam(SafeTensors& tensors, const Adam& adam);
Adam adam_of(const SafeTensors& tensors, const std::vector<Eigen::Map<Eigen::VectorXf>>& parameters,
             const std::string& file);

}  // namespace duet
