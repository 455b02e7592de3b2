// A module of another interface: what a module looks like that was compiled against other types.
#include "duet/backends/engine_module.h"

namespace {

const duet::EngineModule kModule = {.interface = duet::engine_interface() + 1, .name = "stranger", .options = {}};

}  // namespace

DUET_ENGINE_MODULE(kModule)
