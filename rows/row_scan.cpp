#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <bitset>
#include <charconv>
#include <cstdint>
#include <cstring>
#include <random>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/rows/json_fields.h"
#include "duet/rows/row_file.h"

namespace duet {
namespace {

// A field that a scan knows. One of `text`, `whole` and `outcome` is set where it is looked at.
struct ScanField {
  std::string_view name;
  std::string EpisodeRow::*text = nullptr;
  int EpisodeRow::*whole = nullptr;
  Outcome EpisodeRow::*outcome = nullptr;
  bool scanned = false, wall_time = false;
};

// Fields by name: rows are written in that order.
const std::vector<ScanField>& scan_fields() {
  static const std::vector<ScanField> fields = [] {
    std::vector<ScanField> made = {{.name = "schema"}};
    for (const RowField& field : row_fields()) {
      ScanField& known = made.emplace_back(
          ScanField{.name = field.name, .scanned = field.use.scanned, .wall_time = !field.use.repeats});
      if (!field.use.scanned) continue;
      if (const auto* text = std::get_if<std::string EpisodeRow::*>(&field.scanned)) known.text = *text;
      if (const auto* whole = std::get_if<int EpisodeRow::*>(&field.scanned)) known.whole = *whole;
      if (const auto* outcome = std::get_if<Outcome EpisodeRow::*>(&field.scanned)) known.outcome = *outcome;
    }
    std::ranges::sort(made, {}, &ScanField::name);
    return made;
  }();
  return fields;
}

[[noreturn]] void fail_scan(std::string_view expected) {
  throw InputError(fmt::format("episode row: expected {}", expected));
}

constexpr std::uint64_t kEachByte = 0x0101010101010101ULL;

// Marks for eight bytes, read as a word: the lowest bit set stands in the first byte that is `wanted`; 0: none is.
constexpr std::uint64_t byte_marks(std::uint64_t word, char wanted) {
  const std::uint64_t zero_there = word ^ (kEachByte * static_cast<unsigned char>(wanted));
  return (zero_there - kEachByte) & ~zero_there & (kEachByte << 7U);
}
constexpr std::uint64_t text_marks(std::uint64_t word) { return byte_marks(word, '"') | byte_marks(word, '\\'); }
constexpr std::uint64_t nested_marks(std::uint64_t word) {
  const std::uint64_t folded = word | (kEachByte * 0x20U);  // a bracket of either kind becomes a brace
  return byte_marks(word, '"') | byte_marks(folded, '{') | byte_marks(folded, '}');
}

constexpr bool is_text_mark(char c) { return c == '"' || c == '\\'; }
constexpr bool is_nested_mark(char c) { return c == '"' || c == '{' || c == '}' || c == '[' || c == ']'; }

// Where the first mark at or after `place` stands; the text's size where none does. Eight bytes at a time.
template <std::uint64_t marks(std::uint64_t), bool is_mark(char)>
std::size_t next_mark(std::string_view text, std::size_t place) {
  if constexpr (std::endian::native == std::endian::little) {
    for (; place + sizeof(std::uint64_t) <= text.size(); place += sizeof(std::uint64_t)) {
      std::uint64_t word = 0;
      std::memcpy(&word, text.data() + place, sizeof word);
      if (const std::uint64_t found = marks(word); found != 0)
        return place + static_cast<std::size_t>(std::countr_zero(found)) / 8;
    }
  }
  while (place < text.size() && !is_mark(text[place])) ++place;
  return place;
}

constexpr std::array<bool, 256> bytes_of(std::string_view text) {
  std::array<bool, 256> table{};
  for (const char c : text) table[static_cast<unsigned char>(c)] = true;
  return table;
}

// The members of a JSON object, one after the other, as pieces of its text.
class MemberScanner {
 public:
  explicit MemberScanner(std::string_view text) : text_(text) {
    expect('{', "a JSON object");
    space();
  }

  struct Member {
    std::string_view name, value;  // name without its quotes
  };

  // False at the object's end.
  bool next(Member& member) {
    if (at() == '}') {
      ++place_;
      space();
      if (place_ != text_.size()) fail_scan("nothing after the JSON object");
      return false;
    }
    if (!first_) expect(',', "',' or '}' after a value");
    first_ = false;
    space();
    const std::string_view name = text();
    member.name = name.substr(1, name.size() - 2);
    space();
    expect(':', "':' after a key");
    space();
    member.value = value();
    space();
    return true;
  }

 private:
  [[nodiscard]] char at() const { return place_ < text_.size() ? text_[place_] : '\0'; }
  void space() {
    while (at() == ' ' || at() == '\t' || at() == '\r') ++place_;
  }
  void expect(char wanted, std::string_view what) {
    if (at() != wanted) fail_scan(what);
    ++place_;
  }

  // A text with its quotes.
  std::string_view text() {
    const std::size_t begin = place_;
    expect('"', "a text in quotes");
    for (;; place_ += 2) {
      place_ = next_mark<text_marks, is_text_mark>(text_, std::min(place_, text_.size()));
      if (place_ == text_.size()) fail_scan("a text that ends");
      if (text_[place_] == '"') break;
    }
    return text_.substr(begin, ++place_ - begin);
  }

  std::string_view value() {
    const std::size_t begin = place_;
    if (at() == '"') return text();
    if (at() == '{' || at() == '[') {
      nested();
    } else {
      constexpr std::array<bool, 256> kEnds = bytes_of(",}] \t\r");
      while (place_ < text_.size() && !kEnds[static_cast<unsigned char>(text_[place_])]) ++place_;
    }
    if (place_ == begin) fail_scan("a value after a key");
    return text_.substr(begin, place_ - begin);
  }

  void nested() {
    for (int depth = 0;;) {
      place_ = next_mark<nested_marks, is_nested_mark>(text_, place_);
      switch (at()) {
        case '"':
          text();
          continue;
        case '{':
        case '[':
          ++depth;
          break;
        case '\0':
          fail_scan("an object or a list that ends");
        default:
          --depth;
      }
      ++place_;
      if (depth == 0) return;
    }
  }

  std::string_view text_;
  std::size_t place_ = 0;
  bool first_ = true;
};

// The text that a JSON value is, to `text`.
void scan_text(std::string_view name, std::string_view value, std::string& text) {
  if (value.size() < 2 || value.front() != '"')
    fail_scan(fmt::format("a text under the key '{}', found {}", name, excerpt(value)));
  if (value.find('\\') == std::string_view::npos) {
    text.assign(value.substr(1, value.size() - 2));
  } else {
    text = parse_json(value, fmt::format("episode row: key '{}'", name)).get<std::string>();
  }
}

int scanned_integer(std::string_view name, std::string_view value) {
  int number = 0;
  const auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), number);
  if (error != std::errc() || end != value.data() + value.size() || number < 0)
    fail_scan(fmt::format("a whole number of at least 0 under the key '{}', found {}", name, excerpt(value)));
  return number;
}

Outcome scanned_outcome(std::string_view value) {
  std::string name;
  scan_text("outcome", value, name);
  try {
    return parse_outcome(name);
  } catch (const std::invalid_argument& error) {
    throw InputError(fmt::format("episode row: key 'outcome': {}", error.what()));
  }
}

// Drawn once a process: nobody who writes a row knows it.
const std::array<std::uint64_t, 2>& print_key() {
  static const std::array<std::uint64_t, 2> key = [] {
    std::random_device random;
    const auto word = [&] { return std::uint64_t{random()} << 32U | random(); };
    return std::array<std::uint64_t, 2>{word(), word()};
  }();
  return key;
}

// SipHash-1-3 of 128 bits (Aumasson and Bernstein) under a secret key, each piece behind its length: rows that a node
// makes for the purpose cannot be given one print either.
class Fingerprint {
 public:
  void update(std::string_view bytes) {
    constexpr std::size_t kWord = sizeof(std::uint64_t);
    step(bytes.size());
    std::uint64_t word = 0;
    for (; bytes.size() >= kWord; bytes.remove_prefix(kWord)) {
      std::memcpy(&word, bytes.data(), kWord);
      step(word);
    }
    word = 0;
    std::memcpy(&word, bytes.data(), bytes.size());
    step(word);
  }
  [[nodiscard]] std::array<unsigned char, 16> bytes() const {
    Fingerprint last = *this;
    last.v2_ ^= 0xeeU;
    const std::uint64_t first = last.finished();
    last.v1_ ^= 0xddU;
    const std::uint64_t second = last.finished();
    std::array<unsigned char, 16> print{};
    std::memcpy(print.data(), &first, sizeof first);
    std::memcpy(print.data() + sizeof first, &second, sizeof second);
    return print;
  }

 private:
  void step(std::uint64_t word) {
    v3_ ^= word;
    round();
    v0_ ^= word;
  }
  void round() {
    v0_ += v1_;
    v2_ += v3_;
    v1_ = std::rotl(v1_, 13) ^ v0_;
    v3_ = std::rotl(v3_, 16) ^ v2_;
    v0_ = std::rotl(v0_, 32);
    v2_ += v1_;
    v0_ += v3_;
    v1_ = std::rotl(v1_, 17) ^ v2_;
    v3_ = std::rotl(v3_, 21) ^ v0_;
    v2_ = std::rotl(v2_, 32);
  }
  std::uint64_t finished() {
    for (int i = 0; i < 3; ++i) round();
    return v0_ ^ v1_ ^ v2_ ^ v3_;
  }

  std::uint64_t v0_ = print_key()[0] ^ 0x736f6d6570736575ULL, v1_ = print_key()[1] ^ 0x646f72616e646f6dULL ^ 0xeeU,
                v2_ = print_key()[0] ^ 0x6c7967656e657261ULL, v3_ = print_key()[1] ^ 0x7465646279746573ULL;
};

class RowReading {
 public:
  RowReading(std::string_view line, ScannedRow& scanned) : line_(line), scanned_(scanned) {
    MemberScanner members(line);
    for (MemberScanner::Member member; members.next(member);) take(member);
    finish();
  }

 private:
  void take(const MemberScanner::Member& member) {
    const ScanField* known = find(member.name);
    if (known == nullptr) return;
    const auto place = static_cast<std::size_t>(known - fields_.data());
    if (found_.test(place)) fail_scan(fmt::format("each key once, found '{}' twice", known->name));
    if (known->text != nullptr) {
      scan_text(member.name, member.value, scanned_.row.*known->text);
    } else if (known->whole != nullptr) {
      scanned_.row.*known->whole = scanned_integer(member.name, member.value);
    } else if (known->outcome != nullptr) {
      scanned_.row.*known->outcome = scanned_outcome(member.value);
    } else if (member.name == "schema") {
      schema_ = scanned_integer(member.name, member.value);
    }
    found_.set(place);
    if (!known->wall_time) return;
    const auto begin = static_cast<std::size_t>(member.value.data() - line_.data());
    print_.update(line_.substr(done_, begin - done_));
    done_ = begin + member.value.size();
  }

  // The one after the last, as a rule.
  const ScanField* find(std::string_view name) {
    if (next_ < fields_.size() && fields_[next_].name == name) return &fields_[next_++];
    const auto known = std::ranges::lower_bound(fields_, name, {}, &ScanField::name);
    if (known == fields_.end() || known->name != name) return nullptr;
    next_ = static_cast<std::size_t>(known - fields_.begin()) + 1;
    return &*known;
  }

  void finish() {
    if (schema_ != kRowSchema) fail_scan(fmt::format("schema {}, found {}", kRowSchema, schema_));
    for (std::size_t i = 0; i < fields_.size(); ++i)
      if (fields_[i].scanned && !found_.test(i)) fail_scan(fmt::format("the key '{}', found none", fields_[i].name));
    if (const std::string key = episode_key(scanned_.row); key != scanned_.row.key)
      throw InputError(fmt::format("key 'key': expected {}, of what the row says, found {}: the row was changed", key,
                                   excerpt(scanned_.row.key)));
    print_.update(line_.substr(done_));
    scanned_.fingerprint = print_.bytes();
  }

  const std::vector<ScanField>& fields_ = scan_fields();
  std::string_view line_;
  ScannedRow& scanned_;
  Fingerprint print_;
  std::size_t done_ = 0;
  std::size_t next_ = 0;   // in fields_
  std::bitset<64> found_;  // of fields_
  int schema_ = 0;
};

}  // namespace

void scan_row(std::string_view line, ScannedRow& scanned) { RowReading(line, scanned); }

std::string_view scan_member(std::string_view line, std::string_view name) {
  MemberScanner members(line);
  for (MemberScanner::Member member; members.next(member);)
    if (member.name == name) return member.value;
  return {};
}

std::string without_members(std::string_view line, std::span<const std::string_view> names) {
  std::string text;
  std::size_t done = 0;
  MemberScanner members(line);
  for (MemberScanner::Member member; members.next(member);) {
    if (std::ranges::find(names, member.name) == names.end()) continue;
    const auto begin = static_cast<std::size_t>(member.value.data() - line.data());
    text += line.substr(done, begin - done);
    text += member.value.starts_with('[') ? "[]" : "null";
    done = begin + member.value.size();
  }
  return text += line.substr(done);
}

ScannedRow scan_row(std::string_view line) {
  ScannedRow scanned;
  scan_row(line, scanned);
  return scanned;
}

}  // namespace duet
