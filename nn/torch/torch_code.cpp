#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <utility>

#include "duet/core/require.h"
#include "duet/nn/torch/torch_script.h"

namespace duet {
namespace {

using Kind = TorchExpression::Kind;
constexpr int kDeepestExpression = 100;

// One line's expression, from left to right.
class ExpressionReader {
 public:
  ExpressionReader(std::string_view text, std::string_view line) : text_(text), line_(line) {}

  TorchExpression read() {
    TorchExpression expression = value(0);
    skip();
    if (at_ != text_.size()) fail();
    return expression;
  }

 private:
  [[noreturn]] void fail() const { throw TorchCodeFault{std::string(line_)}; }
  void skip() {
    while (at_ < text_.size() && text_[at_] == ' ') ++at_;
  }
  [[nodiscard]] char next() {
    skip();
    return at_ < text_.size() ? text_[at_] : '\0';
  }
  bool take(char c) {
    if (next() != c) return false;
    ++at_;
    return true;
  }

  TorchExpression value(int depth) {
    if (depth > kDeepestExpression) fail();
    TorchExpression found = first(depth);
    for (;;) {
      if (take('[')) {
        TorchExpression index{
            .kind = Kind::kIndex, .name = {}, .parts = {std::move(found), value(depth + 1)}, .keys = {}};
        if (!take(']')) fail();
        found = std::move(index);
      } else if (at_ < text_.size() && text_[at_] == '.') {  // behind a bracket: word() takes a name's own dots
        ++at_;
        TorchExpression call{.kind = Kind::kMethod, .name = word(), .parts = {std::move(found)}, .keys = {""}};
        if (!take('(')) fail();
        arguments(')', depth, call);
        found = std::move(call);
      } else {
        return found;
      }
    }
  }

  TorchExpression first(int depth) {
    const char c = next();
    if (c == '(' || c == '[') return group(c == '(' ? ')' : ']', depth);
    if (c == '"') return quoted();
    if (std::isdigit(static_cast<unsigned char>(c)) != 0 || c == '-' || c == '.') return number();
    TorchExpression name{.kind = Kind::kName, .name = word(), .parts = {}, .keys = {}};
    if (!take('(')) return name;
    name.kind = Kind::kCall;
    arguments(')', depth, name);
    return name;
  }

  // (x) is x, (x, ) and (x, y) are tuples.
  TorchExpression group(char end, int depth) {
    ++at_;
    TorchExpression tuple{.kind = Kind::kTuple, .name = {}, .parts = {}, .keys = {}};
    const bool comma = arguments(end, depth, tuple);
    if (end == ')' && !comma && tuple.parts.size() == 1) return std::move(tuple.parts.front());
    return tuple;
  }

  // Up to and with `end`; whether there was a comma.
  bool arguments(char end, int depth, TorchExpression& to) {
    bool comma = false;
    while (!take(end)) {
      std::string key;
      const std::size_t begin = at_;
      if (next() == '_' || std::isalpha(static_cast<unsigned char>(next())) != 0) {
        key = word();
        if (next() != '=') {
          at_ = begin;
          key.clear();
        } else {
          ++at_;
        }
      }
      to.parts.push_back(value(depth + 1));
      to.keys.push_back(key);
      if (take(','))
        comma = true;
      else if (next() != end)
        fail();
    }
    return comma;
  }

  // "torch.add", "self.actor", "_1".
  std::string word() {
    skip();
    const std::size_t begin = at_;
    while (at_ < text_.size() && (std::isalnum(static_cast<unsigned char>(text_[at_])) != 0 || text_[at_] == '_' ||
                                  (text_[at_] == '.' && at_ > begin)))
      ++at_;
    if (at_ == begin) fail();
    return std::string(text_.substr(begin, at_ - begin));
  }

  TorchExpression number() {
    const std::size_t begin = at_;
    while (at_ < text_.size() && (std::isalnum(static_cast<unsigned char>(text_[at_])) != 0 ||
                                  std::string_view("+-.").find(text_[at_]) != std::string_view::npos))
      ++at_;
    std::string text(text_.substr(begin, at_ - begin));
    if (text.ends_with('.')) text += '0';
    const std::optional<double> number = parse_number(text);
    if (!number) fail();
    return {.kind = Kind::kNumber, .name = {}, .number = *number, .parts = {}, .keys = {}};
  }

  TorchExpression quoted() {
    const std::size_t end = text_.find('"', ++at_);
    if (end == std::string_view::npos) fail();
    TorchExpression text{
        .kind = Kind::kText, .name = std::string(text_.substr(at_, end - at_)), .parts = {}, .keys = {}};
    at_ = end + 1;
    return text;
  }

  std::string_view text_, line_;
  std::size_t at_ = 0;
};

std::string_view without_margin(std::string_view line) {
  const std::size_t begin = line.find_first_not_of(' ');
  return begin == std::string_view::npos ? "" : line.substr(begin);
}

// "a, b, = " and "a = ": the names; the place behind in `begin`.
std::vector<std::string> targets_of(std::string_view line, std::size_t& begin) {
  const std::size_t equals = line.find(" = ");
  std::vector<std::string> names;
  if (equals == std::string_view::npos) return names;
  begin = equals + 3;
  for (std::string_view left = line.substr(0, equals); !left.empty();) {
    const std::size_t comma = left.find(',');
    const std::string_view name = without_margin(left.substr(0, comma));
    const auto is_part = [](char c) {
      return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '.';
    };
    if (!std::ranges::all_of(name, is_part)) return {};
    if (!name.empty()) names.emplace_back(name);
    left.remove_prefix(comma == std::string_view::npos ? left.size() : comma + 1);
  }
  return names;
}

class BodyReader {
 public:
  explicit BodyReader(std::string_view code) {
    while (!code.empty()) {
      const std::size_t end = std::min(code.find('\n'), code.size());
      lines_.push_back(code.substr(0, end));
      code.remove_prefix(std::min(end + 1, code.size()));
    }
  }

  std::vector<TorchStatement> block(std::size_t margin) {
    std::vector<TorchStatement> statements;
    while (at_ < lines_.size() && margin_of(lines_[at_]) == margin && !starts("else:"))
      statements.push_back(statement(margin));
    return statements;
  }

 private:
  static std::size_t margin_of(std::string_view line) { return std::min(line.find_first_not_of(' '), line.size()); }
  [[nodiscard]] bool starts(std::string_view word) const { return without_margin(lines_[at_]).starts_with(word); }

  TorchStatement statement(std::size_t margin) {
    const std::string_view line = without_margin(lines_[at_++]);
    TorchStatement made{.line = std::string(line), .targets = {}, .value = {}, .block = {}, .other = {}};
    const auto expression = [&](std::string_view text) { return ExpressionReader(text, line).read(); };
    if (line == "pass") return made;
    if (line.starts_with("return ")) {
      made.kind = TorchStatement::Kind::kReturn;
      made.value = expression(line.substr(7));
    } else if (line.starts_with("if ") && line.ends_with(":")) {
      made.kind = TorchStatement::Kind::kIf;
      made.value = expression(line.substr(3, line.size() - 4));
      made.block = block(margin + 2);
      if (at_ < lines_.size() && margin_of(lines_[at_]) == margin && starts("else:")) {
        ++at_;
        made.other = block(margin + 2);
      }
    } else {
      std::size_t begin = 0;
      made.kind = TorchStatement::Kind::kAssign;
      made.targets = targets_of(line, begin);
      made.value = expression(line.substr(begin));
    }
    return made;
  }

  std::vector<std::string_view> lines_;
  std::size_t at_ = 0;
};

}  // namespace

std::optional<TorchFunction> torch_method(std::string_view class_source, std::string_view method) {
  const std::string head = fmt::format("  def {}(self", method);
  const std::size_t begin = class_source.find(head);
  if (begin == std::string_view::npos) return std::nullopt;
  const std::size_t end = class_source.find(":\n", begin);
  if (end == std::string_view::npos) return std::nullopt;
  TorchFunction function;
  std::string_view rest = class_source.substr(begin + head.size(), end - begin - head.size());
  rest = rest.substr(0, rest.rfind(") -> "));
  for (std::size_t comma = rest.find(",\n"); comma != std::string_view::npos; comma = rest.find(",\n")) {
    rest = without_margin(rest.substr(comma + 2));
    const std::string_view argument = rest.substr(0, rest.find(",\n"));
    const std::size_t colon = argument.find(": ");
    if (colon == std::string_view::npos) return std::nullopt;
    function.arguments.emplace_back(argument.substr(0, colon));
    function.types.emplace_back(argument.substr(colon + 2));
  }
  constexpr std::size_t kMargin = 4;
  function.body = BodyReader(class_source.substr(end + 2)).block(kMargin);
  return function;
}

}  // namespace duet
