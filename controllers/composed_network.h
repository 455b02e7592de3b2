// The networks of a descriptor as one: an encoder and the policy that is shown its output, for example. Nothing
// allocates after construction. One owner, not thread-safe.
#pragma once

#include <memory>
#include <vector>

#include "duet/controllers/descriptor.h"
#include "duet/nn/network.h"

namespace duet {

// `networks`: those of Descriptor::networks in their order, then the policy's own. Each run evaluates them in that
// order. Its ports are all of theirs: "obs" and "action" of the policy, "NAME.obs" and "NAME.latent" of another. A part
// of an input that is `from` an output has its numbers of the same run. Throws InputError ("FILE:LINE: ...") for an
// output that is not there, of another size, or of a network that does not run before.
std::unique_ptr<Network> compose_networks(const Descriptor& descriptor, std::vector<std::unique_ptr<Network>> networks);

}  // namespace duet
