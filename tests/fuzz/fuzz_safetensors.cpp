// Safetensors files, and the networks that they may hold.
#include "nn/mlp_file.h"
#include "nn/safetensors.h"
#include "tests/fuzz/reader.h"

namespace {

const std::string& sample() {
  static const std::string bytes = [] {
    duet::SafeTensors content;
    content.metadata = {{"kind", "sample"}};
    content.tensors["a.0.weight"] = {{2, 3}, {1, 2, 3, 4, 5, 6}};
    content.tensors["a.0.bias"] = {{2}, {0.5F, -0.5F}};
    return duet::safetensors_bytes(content);
  }();
  return bytes;
}

}  // namespace

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t max_size,
                                               unsigned seed) {
  return duet::fuzz::mutate(data, size, max_size, seed, sample());
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return duet::fuzz::read_or_refuse([&] {
    const duet::SafeTensors content = duet::parse_safetensors(duet::fuzz::text_of(data, size), "fuzz");
    (void)duet::safetensors_bytes(content);  // what was read can be written
    (void)duet::read_mlp(content, "a", "fuzz");
  });
}
