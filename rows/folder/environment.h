// The environment that a result depends on: program, compiler, processor, libraries. No host or user name.
#pragma once

#include <nlohmann/json.hpp>

namespace duet {

nlohmann::json capture_environment();
// "AMD EPYC, 2 cores, AVX-512, GCC 12.2.0, Release": for tables.
std::string describe_machine();

}  // namespace duet
