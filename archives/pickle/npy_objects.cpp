#include "duet/archives/pickle/npy_objects.h"

#include <fmt/format.h>

#include "duet/archives/npy/npy_header.h"
#include "duet/archives/pickle/pickle_machine.h"
#include "duet/core/require.h"

namespace duet {

Pickle parse_object_npy(std::string_view bytes, const std::string& name) {
  NpyHeader header;
  try {
    header = parse_npy_header(bytes, true);
  } catch (const InputError& error) {
    throw InputError(fmt::format("'{}': {}", name, error.what()));
  }
  if (header.type.kind != 'O')
    throw InputError(fmt::format("'{}': expected an array of one Python object, found one of {} {}", name,
                                 header.type.kind == 'U' || header.type.kind == 'S' ? "texts" : "numbers",
                                 shape_text(header.shape)));
  Pickle pickle = parse_pickle(bytes.substr(header.data_begin), name, PickleFlavour::kObjects);
  const PickleNode& root = pickle[pickle.root];
  if (root.kind != PickleKind::kArray || !root.built || pickle[root.data].kind != PickleKind::kList)
    pickle.fail(root.offset, fmt::format("expected an array of objects, found {}", to_string(root.kind)));
  const PickleNode& list = pickle[root.data];
  if (list.items.size() != 1)
    pickle.fail(list.offset, fmt::format("expected an array of one object, found {}", list.items.size()));
  pickle.root = list.items.front();
  return pickle;
}

}  // namespace duet
