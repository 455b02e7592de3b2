#include "duet/archives/npy/npy_header.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <set>

#include "duet/archives/npy/npy_array.h"
#include "duet/core/require.h"
#include "duet/core/text.h"

namespace duet {
namespace {

constexpr std::size_t kMaxDimensions = 32;  // NumPy's own limit

// "<f8", "|b1", ">i4", "<U12".
NpyType parse_type(std::string_view text, bool objects) {
  if (objects && text == "|O") return {'O', false, sizeof(void*)};
  const auto refuse = [&]() -> InputError {
    if (text.find('O') != std::string_view::npos)
      return InputError(fmt::format("object arrays ('{}') hold Python code and are not read", shown(text)));
    return InputError(fmt::format("expected type f2, f4, f8, i1..i8, u1..u8, b1, U or S, found '{}'", shown(text)));
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
      if (!seen.insert(key).second) throw InputError(fmt::format("header names '{}' twice", shown(key)));
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
      throw InputError(fmt::format("header has the unknown key '{}'", shown(key)));
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
