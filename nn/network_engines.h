// Evaluation by libraries that a build may lack. Each has one source that is compiled where the library was found and
// one that says so otherwise; a vendor's header appears only there. Internal to nn/.
#pragma once

#include <memory>
#include <string>

#include "nn/network.h"

namespace duet {

bool onnxruntime_built_in();
bool libtorch_built_in();

// Throw InputError as load_network does; MissingError where the library is not built in.
std::unique_ptr<Network> onnxruntime_network(const std::string& path);
std::unique_ptr<Network> libtorch_network(const std::string& path);

}  // namespace duet
