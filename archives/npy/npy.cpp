#include "duet/archives/npy/npy.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <bit>
#include <charconv>
#include <cstring>
#include <iterator>
#include <limits>
#include <set>
#include <type_traits>

#include "duet/core/numbers.h"
#include "duet/core/require.h"

namespace duet {
namespace {

template <typename T>
T read_value(const char* at, bool swapped) {
  char bytes[sizeof(T)];
  std::memcpy(bytes, at, sizeof(T));
  if (swapped) std::reverse(bytes, bytes + sizeof(T));
  T value;
  std::memcpy(&value, bytes, sizeof(T));
  return value;
}

// `read(at)` for each of `count` items of `item` bytes.
template <typename Value, typename Read>
std::vector<Value> read_items(std::string_view data, std::size_t count, std::size_t item, const Read& read) {
  std::vector<Value> values;
  values.reserve(count);
  for (std::size_t i = 0; i < count; ++i) values.push_back(read(data.data() + i * item));
  return values;
}

// The values that stand from `at` on, as an iterator that a vector is made of without being filled with zeros before.
template <typename Stored, typename Value>
struct StoredValues {
  using iterator_category = std::random_access_iterator_tag;
  using value_type = Value;
  using difference_type = std::ptrdiff_t;
  using pointer = const Value*;
  using reference = Value;

  const char* at = nullptr;

  Value operator*() const {
    Stored stored;
    std::memcpy(&stored, at, sizeof(Stored));
    return static_cast<Value>(stored);
  }
  StoredValues& operator++() {
    at += sizeof(Stored);
    return *this;
  }
  StoredValues operator+(difference_type n) const { return {at + n * static_cast<difference_type>(sizeof(Stored))}; }
  difference_type operator-(const StoredValues& other) const {
    return (at - other.at) / static_cast<difference_type>(sizeof(Stored));
  }
  bool operator==(const StoredValues&) const = default;
};

template <typename Stored, typename Value>
std::vector<Value> read_as(std::string_view data, std::size_t count, bool swapped) {
  if constexpr (!std::is_same_v<Stored, std::uint64_t>) {
    if (!swapped) {  // most files: in one pass over memory
      const StoredValues<Stored, Value> first{data.data()};
      return std::vector<Value>(first, first + static_cast<std::ptrdiff_t>(count));
    }
  }
  return read_items<Value>(data, count, sizeof(Stored), [swapped](const char* at) {
    const Stored stored = read_value<Stored>(at, swapped);
    if constexpr (std::is_same_v<Stored, std::uint64_t>)
      if (stored > static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max()))
        throw InputError(fmt::format("expected integers below 2^63, found {}", stored));
    return static_cast<Value>(stored);
  });
}

void append_utf8(std::string& text, char32_t code) {
  const auto tail = [&](int shift) { text += static_cast<char>(0x80 | ((code >> shift) & 0x3f)); };
  if (code < 0x80) {
    text += static_cast<char>(code);
  } else if (code < 0x800) {
    text += static_cast<char>(0xc0 | (code >> 6));
    tail(0);
  } else if (code < 0x10000) {
    text += static_cast<char>(0xe0 | (code >> 12));
    tail(6), tail(0);
  } else {
    text += static_cast<char>(0xf0 | (code >> 18));
    tail(12), tail(6), tail(0);
  }
}

bool is_code_point(char32_t code) { return code <= 0x10ffff && (code < 0xd800 || code > 0xdfff); }

std::vector<std::string> read_unicode(std::string_view data, std::size_t count, std::size_t characters, bool swapped) {
  return read_items<std::string>(data, count, 4 * characters, [=](const char* at) {
    std::u32string codes(characters, U'\0');
    for (std::size_t c = 0; c < characters; ++c) codes[c] = read_value<std::uint32_t>(at + 4 * c, swapped);
    codes.resize(codes.find_last_not_of(U'\0') + 1);  // npos + 1 == 0
    std::string text;
    for (const char32_t code : codes) {
      if (!is_code_point(code))
        throw InputError(fmt::format("expected Unicode characters, found {:#x}", static_cast<std::uint32_t>(code)));
      append_utf8(text, code);
    }
    return text;
  });
}

std::vector<std::string> read_bytes(std::string_view data, std::size_t count, std::size_t length) {
  return read_items<std::string>(data, count, length, [=](const char* at) {
    const std::string_view text(at, length);
    return std::string(text.substr(0, text.find_last_not_of('\0') + 1));
  });
}

NpyArray::Values read_values(const NpyType& type, std::string_view data, std::size_t count) {
  const bool swapped = type.big_endian != (std::endian::native == std::endian::big);
  switch (type.kind) {
    case 'f':
      if (type.size == 2)
        return read_items<double>(data, count, type.size, [swapped](const char* at) {
          return number_of_half(read_value<std::uint16_t>(at, swapped));
        });
      if (type.size == 4) return read_as<float, double>(data, count, swapped);
      return read_as<double, double>(data, count, swapped);
    case 'i':
      if (type.size == 1) return read_as<std::int8_t, std::int64_t>(data, count, swapped);
      if (type.size == 2) return read_as<std::int16_t, std::int64_t>(data, count, swapped);
      if (type.size == 4) return read_as<std::int32_t, std::int64_t>(data, count, swapped);
      return read_as<std::int64_t, std::int64_t>(data, count, swapped);
    case 'b':
    case 'u':
      if (type.size == 1) return read_as<std::uint8_t, std::int64_t>(data, count, swapped);
      if (type.size == 2) return read_as<std::uint16_t, std::int64_t>(data, count, swapped);
      if (type.size == 4) return read_as<std::uint32_t, std::int64_t>(data, count, swapped);
      return read_as<std::uint64_t, std::int64_t>(data, count, swapped);
    case 'U':
      return read_unicode(data, count, type.size / 4, swapped);
    default:
      return read_bytes(data, count, type.size);
  }
}

// Values in Fortran order -> C order.
template <typename Value>
std::vector<Value> to_row_major(std::vector<Value> values, const std::vector<std::size_t>& shape) {
  if (shape.size() < 2 || values.empty()) return values;
  std::vector<Value> ordered;
  ordered.reserve(values.size());
  std::vector<std::size_t> index(shape.size(), 0), stride(shape.size(), 1);
  for (std::size_t d = 1; d < shape.size(); ++d) stride[d] = stride[d - 1] * shape[d - 1];
  for (std::size_t source = 0; ordered.size() < values.size();) {
    ordered.push_back(std::move(values[source]));
    for (std::size_t d = shape.size(); d-- > 0;) {  // the next index, the last dimension fastest
      source += stride[d];
      if (++index[d] < shape[d]) break;
      source -= stride[d] * shape[d];
      index[d] = 0;
    }
  }
  return ordered;
}

template <typename T>
void append_little_endian(std::string& bytes, T value) {
  char raw[sizeof(T)];
  std::memcpy(raw, &value, sizeof(T));
  if constexpr (std::endian::native == std::endian::big) std::reverse(raw, raw + sizeof(T));
  bytes.append(raw, sizeof(T));
}

std::string header_text(std::string_view type, const std::vector<std::size_t>& shape) {
  std::string sizes;
  for (const std::size_t size : shape) sizes += fmt::format("{}{}", sizes.empty() ? "" : " ", size) + ",";
  if (shape.size() > 1) sizes.pop_back();
  std::string dictionary = fmt::format("{{'descr': '{}', 'fortran_order': False, 'shape': ({}), }}", type, sizes);
  constexpr std::size_t kPrefix = 10, kAlignment = 64;  // magic, version, length; NumPy aligns the data
  while ((kPrefix + dictionary.size() + 1) % kAlignment != 0) dictionary += ' ';
  dictionary += '\n';
  std::string header("\x93NUMPY\x01\x00", 8);
  append_little_endian(header, static_cast<std::uint16_t>(dictionary.size()));
  return header + dictionary;
}

template <typename Value>
std::string number_bytes(std::string_view type, const NpyArray& array, const std::vector<Value>& values) {
  std::string bytes = header_text(type, array.shape);
  bytes.reserve(bytes.size() + values.size() * sizeof(Value));
  if constexpr (std::endian::native == std::endian::little) {  // as they stand in memory
    bytes.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(Value));
  } else {
    for (const Value value : values) append_little_endian(bytes, value);
  }
  return bytes;
}

std::string string_bytes(const NpyArray& array, const std::vector<std::string>& values) {
  std::vector<std::u32string> decoded;
  decoded.reserve(values.size());
  std::size_t longest = 1;  // NumPy has no string type of length 0
  for (const std::string& value : values) longest = std::max(longest, decoded.emplace_back(decode_utf8(value)).size());
  if (values.size() > kMaxEntryBytes / 4 / longest)
    throw InputError(fmt::format("{} strings of up to {} characters are above 1 GiB", values.size(), longest));
  std::string bytes = header_text(fmt::format("<U{}", longest), array.shape);
  for (std::u32string& codes : decoded) {
    codes.resize(longest, U'\0');
    for (const char32_t code : codes) append_little_endian(bytes, static_cast<std::uint32_t>(code));
  }
  return bytes;
}

}  // namespace

std::size_t checked_count(const std::vector<std::size_t>& shape, std::size_t limit) {
  std::size_t count = 1;
  for (const std::size_t size : shape) {
    // Every size counts, also beside a 0: nothing that is read later may overflow an index.
    if (size > limit || (size != 0 && count > limit / size))
      throw InputError(fmt::format("shape {} is above the limit of {} values", shape_text(shape), limit));
    if (size != 0) count *= size;
  }
  return std::find(shape.begin(), shape.end(), std::size_t{0}) == shape.end() ? count : 0;
}

NpyArray parse_npy(std::string_view bytes) {
  if (bytes.size() > kMaxEntryBytes) throw InputError("above 1 GiB");
  const NpyHeader header = parse_npy_header(bytes);
  const bool text = header.type.kind == 'U' || header.type.kind == 'S';
  const std::size_t count = checked_count(header.shape, text ? kMaxArrayStrings : kMaxArrayValues);
  const std::string_view data = bytes.substr(header.data_begin);
  // No overflow: the type's size is at most 2^32 and the count at most 2^27.
  if (data.size() != count * header.type.size)
    throw InputError(fmt::format("shape {} of {}-byte values needs {} bytes of data, found {}",
                                 shape_text(header.shape), header.type.size, count * header.type.size, data.size()));
  NpyArray array{header.shape, read_values(header.type, data, count)};
  if (header.fortran_order)
    std::visit([&](auto& values) { values = to_row_major(std::move(values), array.shape); }, array.values);
  return array;
}

std::string npy_bytes(const NpyArray& array) {
  if (const auto* strings = std::get_if<std::vector<std::string>>(&array.values)) {
    checked_count(array.shape, kMaxArrayStrings);
    return string_bytes(array, *strings);
  }
  checked_count(array.shape, kMaxArrayValues);
  if (const auto* integers = std::get_if<std::vector<std::int64_t>>(&array.values))
    return number_bytes("<i8", array, *integers);
  return number_bytes("<f8", array, std::get<std::vector<double>>(array.values));
}

std::u32string decode_utf8(std::string_view text) {
  std::u32string codes;
  for (std::size_t i = 0; i < text.size();) {
    const std::optional<CodePoint> point = code_point_at(text, i);
    if (!point || point->code == U'\0')
      throw std::invalid_argument(fmt::format("expected UTF-8 text without NUL, found byte {:#04x} at {}",
                                              static_cast<unsigned char>(text[i]), i));
    codes += point->code;
    i += point->length;
  }
  return codes;
}

namespace {

constexpr std::size_t kMaxDimensions = 32;  // NumPy's own limit

// "<f8", "|b1", ">i4", "<U12".
NpyType parse_type(std::string_view text, bool objects) {
  if (objects && text == "|O") return {'O', false, sizeof(void*)};
  const auto refuse = [&]() -> InputError {
    if (text.find('O') != std::string_view::npos)
      return InputError(fmt::format("object arrays ('{}') hold Python code and are not read", excerpt(text)));
    return InputError(fmt::format("expected type f2, f4, f8, i1..i8, u1..u8, b1, U or S, found '{}'", excerpt(text)));
  };
  if (text.size() < 3 || std::string_view("<>|=").find(text[0]) == std::string_view::npos) throw refuse();
  NpyType type{text[1], text[0] == '>', 0};
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data() + 2, end, type.size);
  if (error != std::errc() || stop != end || type.size > kMaxEntryBytes) throw refuse();
  const auto is_one_of = [&](std::initializer_list<std::size_t> sizes) {
    return std::find(sizes.begin(), sizes.end(), type.size) != sizes.end();
  };
  const bool known = (type.kind == 'f' && is_one_of({2, 4, 8})) || (type.kind == 'b' && is_one_of({1})) ||
                     ((type.kind == 'i' || type.kind == 'u') && is_one_of({1, 2, 4, 8})) || type.kind == 'S' ||
                     type.kind == 'U';
  if (!known) throw refuse();
  if (type.kind == 'U') type.size *= 4;
  return type;
}

// Reads the dictionary's literal; every member throws InputError where the text is something else.
class HeaderParser {
 public:
  HeaderParser(std::string_view text, bool objects) : text_(text), objects_(objects) {}

  NpyHeader parse() {
    std::set<std::string_view> seen;
    expect('{');
    while (!accept('}')) {
      const std::string_view key = quoted();
      if (!seen.insert(key).second) throw InputError(fmt::format("header names '{}' twice", excerpt(key)));
      expect(':');
      parse_value(key);
      if (accept('}')) break;
      expect(',');
    }
    skip_spaces();
    if (at_ != text_.size()) throw unexpected("the end");
    if (seen.size() != 3) throw InputError("header lacks one of 'descr', 'fortran_order', 'shape'");
    return header_;
  }

 private:
  void parse_value(std::string_view key) {
    if (key == "descr") {
      if (peek() == '[') throw InputError("expected a plain type, found a structured one");
      header_.type = parse_type(quoted(), objects_);
    } else if (key == "fortran_order") {
      header_.fortran_order = boolean();
    } else if (key == "shape") {
      header_.shape = sizes();
    } else {
      throw InputError(fmt::format("header has the unknown key '{}'", excerpt(key)));
    }
  }

  std::string_view quoted() {
    const char quote = peek();
    if (quote != '\'' && quote != '"') throw unexpected("a quoted name");
    const std::size_t end = text_.find(quote, at_ + 1);
    if (end == std::string_view::npos) throw InputError("header has an open quote");
    const std::string_view name = text_.substr(at_ + 1, end - at_ - 1);
    at_ = end + 1;
    return name;
  }

  bool boolean() {
    skip_spaces();
    for (const std::string_view word : {"True", "False"}) {
      if (!text_.substr(at_).starts_with(word)) continue;
      at_ += word.size();
      return word == "True";
    }
    throw unexpected("True or False");
  }

  std::vector<std::size_t> sizes() {
    std::vector<std::size_t> shape;
    expect('(');
    while (!accept(')')) {
      shape.push_back(size());
      if (shape.size() > kMaxDimensions)
        throw InputError(fmt::format("expected at most {} dimensions", kMaxDimensions));
      if (accept(')')) {
        if (shape.size() == 1) throw InputError("header has a shape that is not a tuple");  // "(3)" is a number
        break;
      }
      expect(',');
    }
    return shape;
  }

  std::size_t size() {
    skip_spaces();
    std::size_t value = 0;
    const auto [stop, error] = std::from_chars(text_.data() + at_, text_.data() + text_.size(), value);
    if (error != std::errc()) throw unexpected("a size");
    at_ = static_cast<std::size_t>(stop - text_.data());
    return value;
  }

  void skip_spaces() {
    while (at_ < text_.size() && (text_[at_] == ' ' || text_[at_] == '\n')) ++at_;
  }
  char peek() {
    skip_spaces();
    return at_ < text_.size() ? text_[at_] : '\0';
  }
  bool accept(char c) {
    if (peek() != c) return false;
    ++at_;
    return true;
  }
  void expect(char c) {
    if (!accept(c)) throw unexpected(fmt::format("'{}'", c));
  }
  [[nodiscard]] InputError unexpected(const std::string& expected) const {
    return InputError(fmt::format("header: expected {} at character {}", expected, at_));
  }

  std::string_view text_;
  bool objects_;
  std::size_t at_ = 0;
  NpyHeader header_;
};

}  // namespace

std::string shape_text(const std::vector<std::size_t>& shape) {
  return fmt::format("({}{})", fmt::join(shape, ", "), shape.size() == 1 ? "," : "");
}

NpyHeader parse_npy_header(std::string_view bytes, bool objects) {
  constexpr std::string_view kMagic = "\x93NUMPY";
  if (!bytes.starts_with(kMagic)) throw InputError("expected an NPY array, found other bytes");
  if (bytes.size() < 12) throw InputError("truncated header");
  const auto byte = [&](std::size_t i) { return static_cast<std::size_t>(static_cast<unsigned char>(bytes[i])); };
  const std::size_t major = byte(6), minor = byte(7);
  if (major < 1 || major > 3 || minor != 0)
    throw InputError(fmt::format("expected NPY version 1.0, 2.0 or 3.0, found {}.{}", major, minor));
  std::size_t length = byte(8) | (byte(9) << 8);
  if (major > 1) length |= (byte(10) << 16) | (byte(11) << 24);
  const std::size_t begin = major > 1 ? 12 : 10;
  if (length > bytes.size() - begin) throw InputError("truncated header");
  NpyHeader header = HeaderParser(bytes.substr(begin, length), objects).parse();
  header.data_begin = begin + length;
  return header;
}

}  // namespace duet
