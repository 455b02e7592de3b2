// Networks from files of every kind that duet reads.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "duet/core/file.h"
#include "duet/nn/network.h"

namespace duet {

// Loads by content, not by name: ONNX with its external data, TorchScript of the kinds in nn/torch/torch_script.h,
// safetensors of nn/mlp.h. Throws InputError (file, place, expected, found) for a file that is unreadable,
// truncated, of another kind, with an operator or a shape that is not supported (by name), or with non-finite weights.
// `engine`: "duet" (ours), or "libtorch" where it was built in (std::invalid_argument otherwise, naming those present).
std::unique_ptr<Network> load_network(const std::string& path, const std::string& engine = "duet");
std::vector<std::string> network_engines();

// Makes networks of one file that is read once: all are of the bytes that were there when it was loaded. Thread-safe.
using NetworkMaker = std::function<std::unique_ptr<Network>()>;

struct NetworkFile {
  NetworkMaker make;
  std::map<std::string, std::string> metadata{};  // what an ONNX file says of itself, by key
};
// Throws as load_network.
NetworkFile load_network_file(const std::string& path, const std::string& engine = "duet");

// The files that the network of that path is loaded from: "network", and for each file of an ONNX model's external data
// "network data NAME"; those that load_network refuses (absent, outside of its folder) are left out. Throws InputError
// where the network cannot be read.
LoadedFiles network_files(const std::string& path);

}  // namespace duet
