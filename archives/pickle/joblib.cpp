#include "duet/archives/pickle/joblib.h"

#include <fmt/format.h>

#include <array>
#include <memory>
#include <utility>

#include "duet/archives/pickle/pickle_machine.h"
#include "duet/archives/zip/inflate.h"
#include "duet/core/require.h"

namespace duet {
namespace {

constexpr std::size_t kMostInflated = std::size_t{1} << 30;

struct Magic {
  std::string_view bytes;
  std::string_view name;
};
constexpr std::array<Magic, 6> kForeign = {{{"BZh", "bz2"},
                                            {"\xfd"
                                             "7zXZ",
                                             "xz"},
                                            {"\x5d", "lzma"},
                                            {"\x04\x22\x4d\x18", "lz4"},
                                            {"\x28\xb5\x2f\xfd", "zstd"},
                                            {"ZF", "the zlib wrapper of joblib before 0.10"}}};

}  // namespace

Pickle parse_joblib(std::string_view bytes, const std::string& name) {
  for (const Magic& magic : kForeign)
    if (bytes.starts_with(magic.bytes))
      throw InputError(
          fmt::format("'{}': compressed with {}: expected no compression, zlib or gzip; write it again "
                      "with joblib.dump(data, path)",
                      name, magic.name));
  if (!bytes.starts_with('\x78') && !bytes.starts_with("\x1f\x8b"))
    return parse_pickle(bytes, name, PickleFlavour::kJoblib);
  auto owned = std::make_unique<const std::string>(inflated(bytes, name, kMostInflated));
  Pickle pickle = parse_pickle(*owned, name, PickleFlavour::kJoblib);
  pickle.owned = std::move(owned);
  return pickle;
}

}  // namespace duet
