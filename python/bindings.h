// Parts of the module duet._duet. pybind11 appears in this folder alone, and nothing here computes: each
// function calls one of the library, with the interpreter's lock released where that takes long. Texts that have a
// structure cross as JSON.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <memory>
#include <span>
#include <vector>

namespace duet::python {

namespace py = pybind11;

void add_plans(py::module_& module);        // environment_binding.cpp
void add_evaluation(py::module_& module);   // evaluation_binding.cpp
void add_archive(py::module_& module);      // archive_binding.cpp
void add_environment(py::module_& module);  // environment_binding.cpp

using Numbers = py::array_t<double, py::array::c_style | py::array::forcecast>;

// Numbers of C++ as an array without a copy; `owner` lives as long as the array.
template <typename T>
py::array view_of(const T* data, const std::vector<py::ssize_t>& shape, const std::vector<py::ssize_t>& strides,
                  const py::object& owner, bool writable = false) {
  py::array array(py::dtype::of<T>(), shape, strides, data, owner);
  if (!writable) array.attr("flags").attr("writeable") = false;
  return array;
}

// A view of an array in C order.
template <typename T>
py::array view_of(const T* data, const std::vector<py::ssize_t>& shape, const py::object& owner) {
  std::vector<py::ssize_t> strides(shape.size(), sizeof(T));
  for (std::size_t i = shape.size(); i-- > 1;) strides[i - 1] = strides[i] * shape[i];
  return view_of(data, shape, strides, owner);
}

}  // namespace duet::python
