// Messages as YAML text: to_yaml, to_flow_style_yaml, to_block_style_yaml.

#ifndef ROSIDL_RUNTIME_CPP__YAML_HPP_
#define ROSIDL_RUNTIME_CPP__YAML_HPP_

#include "rosidl_runtime_cpp/requires_cpp17.hpp"

#include <cstddef>
#include <cstdio>
#include <string>
#include <type_traits>
#include <utility>

namespace rosidl_runtime_cpp
{

/// Collects the text of a message; the generated function write_yaml passes its members.
class YamlWriter
{
public:
  explicit YamlWriter(bool use_flow_style, std::size_t indentation = 0)
  : _flow(use_flow_style), _indentation(indentation)
  {
  }

  /// Write a whole message at the current position.
  template<typename Message>
  void root(const Message & message)
  {
    const bool outer_empty = std::exchange(_empty, true);
    write_yaml(*this, message);
    if (_empty) {
      _text += _flow ? "null" : std::string(_indentation, ' ') + "null\n";
    } else if (_flow) {
      _text += '}';
    }
    _empty = outer_empty;
  }

  /// Write a number or a text; a name of the number becomes a comment in block style.
  template<typename Value>
  void scalar(const char * name, const Value & value, const char * value_name = nullptr)
  {
    begin_member(name, " ");
    append(value);
    if (value_name && !_flow) {
      _text += "  # ";
      _text += value_name;
    }
    end_line();
  }

  void octet(const char * name, unsigned char value)
  {
    begin_member(name, " ");
    append_octet(value);
    end_line();
  }

  template<typename Message>
  void message(const char * name, const Message & value)
  {
    begin_member(name, _flow ? " " : "\n");
    nested(value);
  }

  template<typename Range>
  void scalars(const char * name, const Range & values)
  {
    using Value = typename Range::value_type;
    items(name, values, "- ", [this](const Value & value) {append(value); end_line();});
  }

  template<typename Range>
  void octets(const char * name, const Range & values)
  {
    items(name, values, "- ", [this](unsigned char value) {append_octet(value); end_line();});
  }

  template<typename Range>
  void messages(const char * name, const Range & values)
  {
    using Value = typename Range::value_type;
    items(name, values, "-\n", [this](const Value & value) {nested(value);});
  }

  const std::string & text() const
  {
    return _text;
  }

  template<typename Stream>
  void write_to(Stream & out) const
  {
    out.write(_text.data(), static_cast<std::ptrdiff_t>(_text.size()));
  }

private:
  void begin_member(const char * name, const char * separator)
  {
    if (_flow) {
      _text += _empty ? "{" : ", ";
    } else {
      _text.append(_indentation, ' ');
    }
    _empty = false;
    _text += name;
    _text += ':';
    _text += separator;
  }

  void end_line()
  {
    if (!_flow) {
      _text += '\n';
    }
  }

  template<typename Message>
  void nested(const Message & message)
  {
    _indentation += 2;
    root(message);
    _indentation -= 2;
  }

  /// Write each value with `write`; in block style, each on a separate line after `dash`.
  template<typename Range, typename Write>
  void items(const char * name, const Range & values, const char * dash, Write write)
  {
    if (values.empty()) {
      begin_member(name, " []");
      end_line();
      return;
    }
    begin_member(name, _flow ? " [" : "\n");
    bool first = true;
    for (const auto & value : values) {
      if (!_flow) {
        _text.append(_indentation, ' ');
        _text += dash;
      } else if (!first) {
        _text += ", ";
      }
      first = false;
      write(value);
    }
    if (_flow) {
      _text += ']';
    }
  }

  void append(bool value)
  {
    _text += value ? "true" : "false";
  }

  void append(double value)
  {
    char digits[40];
    append_real(digits, std::snprintf(digits, sizeof(digits), "%#g", value));
  }

  void append(float value)
  {
    append(static_cast<double>(value));
  }

  void append(long double value)
  {
    char digits[40];
    append_real(digits, std::snprintf(digits, sizeof(digits), "%#Lg", value));
  }

  void append(char16_t value)
  {
    _text += "\"\\u";
    append_hexadecimal(value, 4);
    _text += '"';
  }

  template<typename Integer, std::enable_if_t<std::is_integral_v<Integer>, int> = 0>
  void append(Integer value)
  {
    _text += std::to_string(value);
  }

  template<typename Allocator>
  void append(const std::basic_string<char, std::char_traits<char>, Allocator> & value)
  {
    _text += '"';
    for (const char character : value) {
      if (character == '"' || character == '\\') {
        _text += '\\';
      }
      _text += character;
    }
    _text += '"';
  }

  template<typename Allocator>
  void append(const std::basic_string<char16_t, std::char_traits<char16_t>, Allocator> & value)
  {
    _text += '"';
    for (const char16_t unit : value) {
      if (unit < 0x80) {
        _text += static_cast<char>(unit);
      } else {
        _text += unit < 0x100 ? "\\x" : "\\u";
        append_hexadecimal(unit, unit < 0x100 ? 2 : 4);
      }
    }
    _text += '"';
  }

  void append_octet(unsigned char value)
  {
    _text += "0x";
    append_hexadecimal(value, 2);
  }

  void append_hexadecimal(unsigned int value, int digits)
  {
    while (digits > 0) {
      --digits;
      _text += "0123456789abcdef"[(value >> (4 * digits)) & 0xfu];
    }
  }

  /// Replace the decimal separator of the program's locale by a point, as YAML requires.
  void append_real(const char * digits, int length)
  {
    bool foreign = false;
    for (int position = 0; position < length; ++position) {
      const char character = digits[position];
      const bool own = (character >= '0' && character <= '9') || character == '-' ||
        character == '+' || (character >= 'a' && character <= 'z');
      if (own) {
        _text += character;
      } else if (!foreign) {
        _text += '.';
      }
      foreign = !own;
    }
  }

  std::string _text;
  bool _flow;
  bool _empty = true;
  std::size_t _indentation;
};

/// Return the message as text: several lines, or one line such as {x: 1, y: [2, 3]}.
template<typename Message>
auto to_yaml(const Message & message, bool use_flow_style = false)
-> decltype(write_yaml(std::declval<YamlWriter &>(), message), std::string())
{
  YamlWriter writer(use_flow_style);
  writer.root(message);
  return writer.text();
}

template<typename Message, typename Stream>
auto to_flow_style_yaml(const Message & message, Stream & out)
-> decltype(write_yaml(std::declval<YamlWriter &>(), message), void())
{
  YamlWriter writer(true);
  writer.root(message);
  writer.write_to(out);
}

template<typename Message, typename Stream>
auto to_block_style_yaml(const Message & message, Stream & out, std::size_t indentation = 0)
-> decltype(write_yaml(std::declval<YamlWriter &>(), message), void())
{
  YamlWriter writer(false, indentation);
  writer.root(message);
  writer.write_to(out);
}

}  // namespace rosidl_runtime_cpp

namespace rosidl_generator_traits
{

template<typename Message, typename Stream>
[[deprecated("use to_block_style_yaml of the message's namespace")]]
void to_yaml(const Message & message, Stream & out, std::size_t indentation = 0)
{
  ::rosidl_runtime_cpp::to_block_style_yaml(message, out, indentation);
}

template<typename Message>
[[deprecated("use to_yaml of the message's namespace")]]
std::string to_yaml(const Message & message)
{
  return ::rosidl_runtime_cpp::to_yaml(message);
}

}  // namespace rosidl_generator_traits

#endif  // ROSIDL_RUNTIME_CPP__YAML_HPP_
