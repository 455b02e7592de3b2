#include "duet/robots/xml_nesting.h"

#include <fmt/format.h>

#include <algorithm>

#include "duet/core/require.h"

namespace duet {
namespace {

// Goes from markup to markup: "<a" goes one level down, "/>" and "</" go one up. TinyXML may take for something else
// what this counts as an element (it then nests less), but never the other way round: no tag holds a '<' here, and what
// has rules of its own for quotes ("<?xml", "<!DOCTYPE") stands where there is no level to lose.
class Nesting {
 public:
  Nesting(std::string_view text, const std::string& file) : text_(text), file_(file) {}

  void check() {
    for (at_ = text_.find('<'); at_ != std::string_view::npos; at_ = text_.find('<', at_)) {
      const std::string_view rest = text_.substr(at_);
      if (rest.starts_with("<!--")) {
        skip_past("-->", 4);
      } else if (rest.starts_with("<![CDATA[")) {
        skip_past("]]>", 9);
      } else {
        take_tag(rest);
      }
    }
  }

 private:
  void take_tag(std::string_view rest) {
    const std::string_view tag = rest.substr(0, tag_length(rest));
    const char kind = tag[1];
    if (kind == '!' || kind == '?') {
      if (depth_ > 0) fail(fmt::format("'<{}' only outside of all elements, found it inside", kind));
    } else if (kind == '/') {
      depth_ = std::max(depth_ - 1, 0);
    } else if (tag[tag.size() - 2] != '/') {
      if (++depth_ > kMostXmlDepth)
        fail(fmt::format("elements of at most {} levels, found one that is deeper", kMostXmlDepth));
    }
    at_ += tag.size();
  }

  // Up to and with its '>'; a '>' between quotes belongs to a value.
  [[nodiscard]] std::size_t tag_length(std::string_view rest) const {
    char quote = '\0';
    const bool has_values = rest.size() > 1 && rest[1] != '!' && rest[1] != '?' && rest[1] != '/';
    for (std::size_t i = 1; i < rest.size() && rest[i] != '<'; ++i) {
      if (quote != '\0') {
        if (rest[i] == quote) quote = '\0';
      } else if (rest[i] == '>') {
        return i + 1;
      } else if (has_values && (rest[i] == '"' || rest[i] == '\'')) {
        quote = rest[i];
      }
    }
    fail("well-formed XML, found a tag without its '>'");
  }

  void skip_past(std::string_view end, std::size_t begin) {
    const std::size_t found = text_.find(end, at_ + begin);
    if (found == std::string_view::npos) fail(fmt::format("well-formed XML, found no end '{}'", end));
    at_ = found + end.size();
  }

  [[noreturn]] void fail(const std::string& problem) const {
    const auto line = 1 + std::ranges::count(text_.substr(0, at_), '\n');
    throw InputError(fmt::format("{}:{}: expected {}", file_, line, problem));
  }

  std::string_view text_;
  const std::string& file_;
  std::size_t at_ = 0;
  int depth_ = 0;
};

}  // namespace

void check_xml_nesting(std::string_view text, const std::string& file) { Nesting(text, file).check(); }

}  // namespace duet
