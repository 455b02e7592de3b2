// Stands for nn/libtorch_network.cpp where libtorch was not found.
#include "duet/core/require.h"
#include "duet/nn/network.h"

namespace duet {

bool libtorch_built_in() { return false; }

std::unique_ptr<Network> libtorch_network(const std::string&, const std::string& path) {
  throw MissingError("cannot read '" + path + "': this build has no libtorch");
}

}  // namespace duet
