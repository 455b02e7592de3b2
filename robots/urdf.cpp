#include "duet/robots/urdf.h"

#include <console_bridge/console.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <urdf_parser/urdf_parser.h>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <map>
#include <mutex>
#include <numbers>
#include <optional>
#include <set>

#include "duet/core/require.h"

namespace duet {
namespace {

constexpr int kMostJoints = 1000;  // a humanoid with two hands that have fingers has about 100

// urdfdom reports through a process-wide handler that prints to the console. Its errors are collected here instead.
class Collector final : public console_bridge::OutputHandler {
 public:
  void log(const std::string& text, console_bridge::LogLevel level, const char* /*file*/, int /*line*/) override {
    if (level == console_bridge::CONSOLE_BRIDGE_LOG_ERROR) errors.push_back(text);
  }
  std::vector<std::string> errors;
};

// The handler is global to the process: one parse at a time. The reason for this function's static.
std::mutex& console_bridge_mutex() {
  static std::mutex mutex;
  return mutex;
}

void remove_children(TiXmlElement& element, const char* name) {
  while (TiXmlElement* child = element.FirstChildElement(name)) element.RemoveChild(child);
}

std::string attribute(const TiXmlElement& joint, const char* child) {
  const TiXmlElement* const element = joint.FirstChildElement(child);
  const char* const link = element == nullptr ? nullptr : element->Attribute("link");
  return link == nullptr ? "" : link;
}

// Where links follow each other in a circle urdfdom builds links that hold each other for ever; where the chain is very
// long, it ends the program by recursion.
void check_joints(const TiXmlElement& robot, const std::string& file) {
  std::map<std::string, std::vector<std::string>> children;
  std::map<std::string, int> parents;  // how many joints end in a link and have not been walked through
  int joints = 0;
  for (const TiXmlElement* joint = robot.FirstChildElement("joint"); joint != nullptr;
       joint = joint->NextSiblingElement("joint")) {
    if (++joints > kMostJoints)
      throw InputError(fmt::format("{}: expected at most {} joints, found more", file, kMostJoints));
    const std::string parent = attribute(*joint, "parent"), child = attribute(*joint, "child");
    if (parent.empty() || child.empty()) continue;  // urdfdom says what is missing
    children[parent].push_back(child);
    ++parents[child];
  }
  std::vector<std::string> roots;
  for (const auto& [link, ends] : children)
    if (!parents.contains(link)) roots.push_back(link);
  while (!roots.empty()) {
    const std::string link = roots.back();
    roots.pop_back();
    for (const std::string& child : children[link])
      if (--parents[child] == 0) roots.push_back(child);
  }
  for (const auto& [link, left] : parents)
    if (left > 0)
      throw InputError(fmt::format("{}: link '{}': expected joints that form a tree, found a cycle", file, link));
}

// Checks the encoding by the file's first bytes.
void check_encoding(std::string_view text, const std::string& file) {
  const auto begins = [&](std::string_view bytes) { return text.starts_with(bytes); };
  const bool wide = begins("\xff\xfe") || begins("\xfe\xff") || begins(std::string_view("<\0", 2)) ||
                    begins(std::string_view("\0<", 2)) || begins(std::string_view("\0\0", 2));
  if (wide) throw InputError(fmt::format("{}: expected UTF-8, found UTF-16 or UTF-32: save it as UTF-8", file));
}

// Files of other kinds that come with robots, by what they begin with or what their outermost element is.
void refuse_mesh(std::string_view text, const std::string& file) {
  const size_t first = std::min(text.find_first_not_of(" \t\r\n"), text.size());
  const std::string_view begin = text.substr(first);
  const bool binary = text.substr(0, 512).find('\0') != std::string_view::npos;
  if (begin.starts_with("solid") || begin.starts_with("ply\n") || begin.starts_with("glTF") || binary)
    throw InputError(
        fmt::format("{}: expected a URDF, found a mesh or another binary file: a description names meshes, and has "
                    "links, joints and inertias",
                    file));
}

[[noreturn]] void refuse_root(const TiXmlDocument& document, const std::string& file) {
  const TiXmlElement* const root = document.RootElement();
  const std::string name = root == nullptr ? "" : root->ValueStr();
  if (name == "mujoco" || name == "sdf" || name == "COLLADA" || name == "model")
    throw InputError(fmt::format(
        "{}: expected a URDF, whose first element is <robot>, found <{}>: {}", file, name,
        name == "COLLADA" ? "a mesh" : "a description of another format; take the maker's URDF or convert it"));
  throw InputError(fmt::format("{}: expected the element <robot>, found none", file));
}

// A file that xacro is still to be run on: any of its elements, or "${...}" and "$(...)" in an attribute.
void refuse_xacro(const TiXmlElement& element, const std::string& file) {
  const auto refuse = [&](const std::string& found) {
    throw InputError(fmt::format("{}:{}: expected a URDF, found {}: xacro is not expanded; run `xacro {} > robot.urdf`",
                                 file, element.Row(), found, file));
  };
  if (element.ValueStr().starts_with("xacro:")) refuse(fmt::format("the element <{}>", excerpt(element.ValueStr())));
  for (const TiXmlAttribute* one = element.FirstAttribute(); one != nullptr; one = one->Next())
    if (one->ValueStr().find("${") != std::string::npos || one->ValueStr().find("$(") != std::string::npos)
      refuse(fmt::format("'{}' in an attribute of <{}>", excerpt(one->ValueStr()), excerpt(element.ValueStr())));
  for (const TiXmlElement* child = element.FirstChildElement(); child != nullptr; child = child->NextSiblingElement())
    refuse_xacro(*child, file);
}

// Three numbers of an attribute; none where there are not three that are finite and of a robot's size.
std::optional<Eigen::Vector3d> three_numbers(const char* text) {
  constexpr double kMostSize = 100.0;
  Eigen::Vector3d v;
  if (text == nullptr || std::sscanf(text, "%lf %lf %lf", &v.x(), &v.y(), &v.z()) != 3) return std::nullopt;
  if (!v.allFinite() || v.cwiseAbs().maxCoeff() > kMostSize) return std::nullopt;
  return v;
}

// A collision element as the box around it; none for a mesh, and for one that says too little.
std::optional<UrdfBox> box_of(const TiXmlElement& collision) {
  const TiXmlElement* const geometry = collision.FirstChildElement("geometry");
  const TiXmlElement* const shape = geometry == nullptr ? nullptr : geometry->FirstChildElement();
  if (shape == nullptr) return std::nullopt;
  UrdfBox box;
  double radius = 0.0, length = 0.0;
  if (const TiXmlElement* const origin = collision.FirstChildElement("origin")) {
    box.X_LB.p = three_numbers(origin->Attribute("xyz")).value_or(Eigen::Vector3d::Zero());
    const Eigen::Vector3d rpy = three_numbers(origin->Attribute("rpy")).value_or(Eigen::Vector3d::Zero());
    box.X_LB.R = Eigen::AngleAxisd(rpy.z(), Eigen::Vector3d::UnitZ()) *
                 Eigen::AngleAxisd(rpy.y(), Eigen::Vector3d::UnitY()) *
                 Eigen::AngleAxisd(rpy.x(), Eigen::Vector3d::UnitX());
  }
  if (shape->ValueStr() == "box") {
    const std::optional<Eigen::Vector3d> size = three_numbers(shape->Attribute("size"));
    if (!size) return std::nullopt;
    box.half = 0.5 * *size;
  } else if (shape->QueryDoubleAttribute("radius", &radius) == TIXML_SUCCESS) {
    if (shape->QueryDoubleAttribute("length", &length) != TIXML_SUCCESS) length = 2.0 * radius;
    box.half = {radius, radius, 0.5 * length};
  }
  const bool solid = box.half.allFinite() && box.half.minCoeff() > 0.0 && box.half.maxCoeff() < 100.0;
  return solid ? std::optional(box) : std::nullopt;
}

std::map<std::string, std::vector<UrdfBox>> boxes_of(const TiXmlElement& robot) {
  std::map<std::string, std::vector<UrdfBox>> boxes;
  for (const TiXmlElement* link = robot.FirstChildElement("link"); link != nullptr;
       link = link->NextSiblingElement("link")) {
    const char* const name = link->Attribute("name");
    for (const TiXmlElement* one = link->FirstChildElement("collision"); one != nullptr && name != nullptr;
         one = one->NextSiblingElement("collision"))
      if (const std::optional<UrdfBox> box = box_of(*one)) boxes[name].push_back(*box);
  }
  return boxes;
}

// The text without what duet does not look at: a shape or material that urdfdom does not know is then no error.
std::string without_geometry(const std::string& text, const std::string& file,
                             std::map<std::string, std::vector<UrdfBox>>& boxes) {
  if (text.find_first_not_of(" \t\r\n") == std::string::npos)
    throw InputError(fmt::format("{}: expected a URDF, found an empty file", file));
  check_encoding(text, file);
  refuse_mesh(text, file);
  check_xml_nesting(text, file);
  TiXmlDocument document;
  document.Parse(text.c_str());
  if (document.Error())
    throw InputError(fmt::format("{}:{}: expected well-formed XML, found: {}", file, std::max(document.ErrorRow(), 1),
                                 document.ErrorDesc()));
  TiXmlElement* const robot = document.FirstChildElement("robot");
  if (robot == nullptr) refuse_root(document, file);
  refuse_xacro(*robot, file);
  check_joints(*robot, file);
  boxes = boxes_of(*robot);
  for (const char* name : {"material", "transmission", "gazebo", "mujoco", "sensor"}) remove_children(*robot, name);
  for (TiXmlElement* link = robot->FirstChildElement("link"); link != nullptr; link = link->NextSiblingElement("link"))
    for (const char* name : {"visual", "collision"}) remove_children(*link, name);
  TiXmlPrinter printer;
  document.Accept(&printer);
  return printer.Str();
}

// urdfdom's sentences in the house's form where they do not say what was expected.
std::string reworded(std::string error) {
  while (!error.empty() && (error.back() == '.' || std::isspace(static_cast<unsigned char>(error.back()))))
    error.pop_back();
  constexpr std::string_view kTwo = "Two root links found: ";
  if (const size_t at = error.find(kTwo); at != std::string::npos)
    return "expected one root (a link that is no joint's child), found two: " + error.substr(at + kTwo.size());
  return error;
}

[[noreturn]] void refuse(const std::string& file, const std::vector<std::string>& errors) {
  // Parsers report from the inside out, may say the same twice, and end with a sentence that names nothing.
  std::vector<std::string> sentences;
  for (const std::string& error : errors) {
    const std::string sentence = reworded(error);
    if (sentence.find("xml is not initialized correctly") != std::string::npos && !sentences.empty()) continue;
    if (std::find(sentences.begin(), sentences.end(), sentence) == sentences.end()) sentences.push_back(sentence);
  }
  throw InputError(fmt::format("{}: not a valid URDF: {}", file,
                               excerpt(fmt::format("{}", fmt::join(sentences, "; ")), kShownSentence)));
}

urdf::ModelInterfaceSharedPtr parse(const std::string& text, const std::string& file) {
  const std::scoped_lock lock(console_bridge_mutex());
  Collector collector;
  console_bridge::OutputHandler* const previous = console_bridge::getOutputHandler();
  const console_bridge::LogLevel level = console_bridge::getLogLevel();
  console_bridge::useOutputHandler(&collector);
  console_bridge::setLogLevel(console_bridge::CONSOLE_BRIDGE_LOG_ERROR);
  urdf::ModelInterfaceSharedPtr model;
  try {
    model = urdf::parseURDF(text);
  } catch (const std::exception& error) {
    collector.errors.emplace_back(error.what());
  }
  console_bridge::useOutputHandler(previous);
  console_bridge::setLogLevel(level);
  // urdfdom goes on after some errors, for instance without an inertia that it could not read.
  if (!model || !model->getRoot() || !collector.errors.empty()) refuse(file, collector.errors);
  return model;
}

Pose to_pose(const urdf::Pose& pose) {
  double x = 0.0, y = 0.0, z = 0.0, w = 1.0;
  pose.rotation.getQuaternion(x, y, z, w);
  return {Eigen::Quaterniond(w, x, y, z).normalized(), {pose.position.x, pose.position.y, pose.position.z}};
}

void check_finite(const Pose& X, const std::string& file, const std::string& element) {
  if (!X.p.allFinite() || !X.R.coeffs().allFinite())
    throw InputError(fmt::format("{}: {}: expected a finite origin, found one that is not", file, element));
}

UrdfLink to_link(const urdf::Link& source, const std::string& file) {
  UrdfLink link;
  link.name = source.name;
  if (!source.inertial) return link;
  const urdf::Inertial& inertial = *source.inertial;
  const std::string element = fmt::format("link '{}'", source.name);
  if (!std::isfinite(inertial.mass) || inertial.mass < 0.0)
    throw InputError(fmt::format("{}: {}: expected a mass >= 0, found {}", file, element, inertial.mass));
  const Pose X_LI = to_pose(inertial.origin);
  check_finite(X_LI, file, element + " inertial");
  Eigen::Matrix3d I;
  I << inertial.ixx, inertial.ixy, inertial.ixz,  //
      inertial.ixy, inertial.iyy, inertial.iyz,   //
      inertial.ixz, inertial.iyz, inertial.izz;
  if (!I.allFinite()) throw InputError(fmt::format("{}: {}: expected a finite inertia", file, element));
  // An all-zero inertia is a point mass; what the links become after merging is checked by the loader.
  const double least = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(I, Eigen::EigenvaluesOnly).eigenvalues()[0];
  if (least < -1e-12)
    throw InputError(
        fmt::format("{}: {}: expected an inertia with principal moments >= 0, found {:.3g}", file, element, least));
  link.mass = inertial.mass;
  link.com = X_LI.p;
  const Eigen::Matrix3d R = X_LI.R.toRotationMatrix();
  link.inertia = R * I * R.transpose();
  return link;
}

UrdfJointType to_type(const urdf::Joint& joint, const std::string& file) {
  switch (joint.type) {
    case urdf::Joint::FIXED:
      return UrdfJointType::kFixed;
    case urdf::Joint::REVOLUTE:
      return UrdfJointType::kRevolute;
    case urdf::Joint::CONTINUOUS:
      return UrdfJointType::kContinuous;
    case urdf::Joint::PRISMATIC:
      return UrdfJointType::kPrismatic;
    case urdf::Joint::FLOATING:
      return UrdfJointType::kFloating;
    case urdf::Joint::PLANAR:
      return UrdfJointType::kPlanar;
    default:
      throw InputError(fmt::format("{}: joint '{}': expected a known type, found none", file, joint.name));
  }
}

void read_limits(const urdf::Joint& source, const std::string& file, UrdfJoint& joint) {
  if (source.limits) {
    joint.lower = source.limits->lower;
    joint.upper = source.limits->upper;
    joint.effort = source.limits->effort;
    joint.velocity = source.limits->velocity;
  }
  if (joint.type == UrdfJointType::kContinuous) {
    joint.lower = -2.0 * std::numbers::pi;
    joint.upper = 2.0 * std::numbers::pi;
  }
  for (const double value : {joint.lower, joint.upper, joint.effort, joint.velocity})
    if (!std::isfinite(value))
      throw InputError(fmt::format("{}: joint '{}': expected finite limits", file, joint.name));
}

UrdfJoint to_joint(const urdf::Joint& source, const std::string& file) {
  UrdfJoint joint;
  joint.name = source.name;
  joint.type = to_type(source, file);
  const std::string element = fmt::format("joint '{}'", source.name);
  joint.X_PC = to_pose(source.parent_to_joint_origin_transform);
  check_finite(joint.X_PC, file, element);
  if (joint.type == UrdfJointType::kFixed || joint.type == UrdfJointType::kFloating) return joint;
  const Eigen::Vector3d axis(source.axis.x, source.axis.y, source.axis.z);
  if (!axis.allFinite() || axis.norm() < 1e-9)
    throw InputError(fmt::format("{}: {}: expected an axis with a direction, found ({}, {}, {})", file, element,
                                 axis.x(), axis.y(), axis.z()));
  joint.axis = axis.normalized();
  if (source.mimic) {
    joint.mimics = source.mimic->joint_name;
    joint.mimic_factor = source.mimic->multiplier;
    joint.mimic_offset = source.mimic->offset;
  }
  if (source.dynamics) {
    joint.damping = source.dynamics->damping;
    joint.friction = source.dynamics->friction;
  }
  read_limits(source, file, joint);
  return joint;
}

}  // namespace

const char* to_string(UrdfJointType type) {
  switch (type) {
    case UrdfJointType::kFixed:
      return "fixed";
    case UrdfJointType::kRevolute:
      return "revolute";
    case UrdfJointType::kContinuous:
      return "continuous";
    case UrdfJointType::kPrismatic:
      return "prismatic";
    case UrdfJointType::kFloating:
      return "floating";
    case UrdfJointType::kPlanar:
      return "planar";
  }
  return "unknown";
}

UrdfModel parse_urdf(const std::string& text, const std::string& file) {
  std::map<std::string, std::vector<UrdfBox>> boxes;
  const urdf::ModelInterfaceSharedPtr source = parse(without_geometry(text, file, boxes), file);
  UrdfModel model;
  std::set<std::string> visited;
  const std::function<void(const urdf::Link&)> visit = [&](const urdf::Link& link) {
    if (!visited.insert(link.name).second)
      throw InputError(fmt::format("{}: link '{}': expected one parent, found two", file, excerpt(link.name)));
    const int index = static_cast<int>(model.links.size());
    model.links.push_back(to_link(link, file));
    model.links.back().boxes = boxes[link.name];
    for (const urdf::JointSharedPtr& child : link.child_joints) {
      UrdfJoint joint = to_joint(*child, file);
      joint.parent = index;
      joint.child = static_cast<int>(model.links.size());
      model.joints.push_back(joint);
      visit(*source->getLink(child->child_link_name));
    }
  };
  visit(*source->getRoot());
  return model;
}

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
