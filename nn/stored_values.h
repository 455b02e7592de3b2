// Vectors, matrices, texts and numbers among the tensors and the metadata of a safetensors file. Reading throws
// InputError naming the file, what is missing, and what was expected and found.
#pragma once

#include <Eigen/Core>
#include <string>

#include "duet/nn/safetensors.h"

namespace duet {

Tensor tensor_of(const Eigen::Ref<const Eigen::VectorXf>& values);
// (columns, rows): a column's numbers follow each other in memory and in the file.
Tensor columns_tensor(const Eigen::Ref<const Eigen::MatrixXf>& matrix);

const Tensor& tensor_named(const SafeTensors& content, const std::string& name, const std::string& file);
Eigen::VectorXf vector_of(const SafeTensors& content, const std::string& name, Eigen::Index size,
                          const std::string& file);
// The matrix that columns_tensor stored.
Eigen::MatrixXf columns_of(const SafeTensors& content, const std::string& name, Eigen::Index rows, Eigen::Index columns,
                           const std::string& file);
std::string text_of(const SafeTensors& content, const std::string& key, const std::string& file);
double number_of(const SafeTensors& content, const std::string& key, const std::string& file);
// Throws unless the metadata of `key` is this; 'format' is a key.
void expect_text(const SafeTensors& content, const std::string& key, const std::string& expected,
                 const std::string& file);

}  // namespace duet
