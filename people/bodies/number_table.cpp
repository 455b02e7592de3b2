#include "duet/people/bodies/number_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "duet/archives/npy/npy.h"
#include "duet/archives/npy/npy_header.h"
#include "duet/archives/pickle/pickle_machine.h"
#include "duet/core/require.h"
#include "duet/core/text.h"

namespace duet {
namespace {

constexpr std::size_t kMostRows = 20'000'000;  // two days at 120 Hz

NumberTable checked(NumberTable table) {
  for (std::size_t i = 0; i < table.values.size(); ++i)
    if (!std::isfinite(table.values[i])) {
      const std::size_t row = table.shape.empty() ? 1 : table.values.size() / std::max<std::size_t>(table.shape[0], 1);
      table.fail(
          fmt::format("expected finite numbers, found {} at row {}, number {}", table.values[i], i / row, i % row));
    }
  return table;
}

std::vector<double> doubles(const NpyArray& array, const std::string& what) {
  if (const auto* integers = std::get_if<std::vector<std::int64_t>>(&array.values))
    return {integers->begin(), integers->end()};
  if (const auto* numbers = std::get_if<std::vector<double>>(&array.values)) return *numbers;
  throw InputError(what + ": expected numbers, found texts");
}

}  // namespace

void NumberTable::fail(const std::string& fault) const { throw InputError(what + ": " + fault); }

std::string NumberTable::found() const { return shape_text(shape); }

NumberTable table_of(const Npz& npz, const std::string& key) {
  return table_of(npz.array(key), fmt::format("'{}': array '{}'", npz.name(), shown(key)));
}

NumberTable table_of(const Pickle& pickle, const PickleNode& node, const std::string& what) {
  PickleNumbers numbers = pickle_numbers(pickle, node, what);
  return checked({.what = fmt::format("'{}': byte {}: {}", pickle.name, node.offset, what),
                  .shape = std::move(numbers.shape),
                  .values = std::move(numbers.values)});
}

NumberTable table_of(const TorchFile& file, const PickleNode& node, const std::string& what) {
  return checked({.what = fmt::format("'{}': {}", file.pickle.name, what),
                  .shape = node.shape,
                  .values = tensor_values(file, node, what)});
}

NumberTable table_of(const NpyArray& array, const std::string& what) {
  return checked({.what = what, .shape = array.shape, .values = doubles(array, what)});
}

NumberTable npy_table(std::string_view bytes, const std::string& name) {
  const std::string what = fmt::format("'{}'", name);
  try {
    return table_of(parse_npy(bytes), what);
  } catch (const InputError& error) {
    if (std::string_view(error.what()).starts_with(what)) throw;
    throw InputError(fmt::format("{}: {}", what, error.what()));
  }
}

const NumberTable& checked_rows(const NumberTable& table, std::initializer_list<std::size_t> row_sizes,
                                const std::string& expected, int rows) {
  const std::size_t count = table.shape.empty() ? 0 : table.shape.front();
  const std::size_t row_size = count == 0 ? 0 : table.values.size() / count;
  if (count == 0 || count > kMostRows || std::find(row_sizes.begin(), row_sizes.end(), row_size) == row_sizes.end())
    table.fail(fmt::format("expected shape {}, found {}", expected, table.found()));
  if (rows != 0 && table.rows() != rows) table.fail(fmt::format("expected {} frames, found {}", rows, table.rows()));
  return table;
}

NumberTable columns_of(const NumberTable& table, std::size_t first, std::size_t count) {
  const std::size_t rows = table.shape[0], width = table.values.size() / rows;
  NumberTable part{.what = table.what, .shape = {rows, count}, .values = {}};
  part.values.reserve(rows * count);
  for (std::size_t t = 0; t < rows; ++t) {
    const auto row = table.values.begin() + static_cast<std::ptrdiff_t>(t * width + first);
    part.values.insert(part.values.end(), row, row + static_cast<std::ptrdiff_t>(count));
  }
  return part;
}

}  // namespace duet
