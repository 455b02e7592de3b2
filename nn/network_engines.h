// Evaluation by a library that a build may lack: one source is compiled where the library was found and one that says
// so otherwise; the vendor's header appears only there. Internal to nn/.
#pragma once

#include <memory>
#include <string>

#include "duet/nn/network.h"

namespace duet {

bool libtorch_built_in();

// A network from a file's bytes; `path` is for messages. Throws InputError as load_network does; MissingError where the
// library is not built in.
std::unique_ptr<Network> libtorch_network(const std::string& bytes, const std::string& path);

}  // namespace duet
