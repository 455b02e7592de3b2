// The code that a TorchScript archive keeps of a module's methods, as PyTorch prints it: a small part of Python, one
// expression a line. It is read, not run. Internal to nn/. Thread-safe.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace duet {

struct TorchExpression {
  // kName: "x", "self.actor", "None", "True"; kCall: a function of that name; kMethod: of parts[0]; kIndex: parts[0] at
  // parts[1]; kTuple: also a list.
  enum class Kind { kName, kNumber, kText, kCall, kMethod, kTuple, kIndex };
  Kind kind = Kind::kName;
  std::string name;  // of a kName, a kCall's function, a kMethod's method; the text of a kText
  double number = 0.0;
  std::vector<TorchExpression> parts;  // arguments; a kMethod's and a kIndex's object first
  std::vector<std::string> keys;       // of each part of a call: "" or the name that it is given by
};

struct TorchStatement {
  enum class Kind { kAssign, kReturn, kIf, kPass };
  Kind kind = Kind::kPass;
  std::string line;                   // for messages
  std::vector<std::string> targets;   // of kAssign: more than one where a tuple is taken apart
  TorchExpression value;              // of kIf the condition
  std::vector<TorchStatement> block;  // of kIf
  std::vector<TorchStatement> other;  // its else
};

struct TorchFunction {
  std::vector<std::string> arguments;  // without self
  std::vector<std::string> types;      // of these: "Tensor"
  std::vector<TorchStatement> body;
};

// A line that is no such code, of the method.
struct TorchCodeFault {
  std::string line;
};

// The method of a class's text; none where it has none. Throws TorchCodeFault.
std::optional<TorchFunction> torch_method(std::string_view class_source, std::string_view method);

}  // namespace duet
