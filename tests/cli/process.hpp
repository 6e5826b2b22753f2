/// Runs the built program as a person would: arguments in, exit status and both streams out.
#pragma once

#include <sys/types.h>

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace berth::test {

struct Outcome {
  int status = -1;  ///< exit status; 128 + signal when it was killed; -1 when it did not end in time
  std::string out;
  std::string err;
};

using Words = std::vector<std::string>;

/// Looks again and again until it is so; false when it was not within two minutes, which is no figure of the product:
/// a machine that does much else needs some of it. The pause is between two looks, and nothing rests on it.
[[nodiscard]] bool eventually(const std::function<bool()>& so);

/// Runs `berth` to its end; killed after two minutes.
[[nodiscard]] Outcome berth(const Words& arguments);

/// The terminal that a `berth` is started on.
struct OnTerminal {
  unsigned short columns = 100;
  unsigned short rows = 40;
  std::string type = "xterm";  ///< TERM; empty: unset
  bool colours = true;         ///< false: NO_COLOR is set
  bool errors = false;         ///< they come on it, too, as in a shell
};

/// A `berth` that keeps running, on a terminal when told so. Killed with its object.
class Background {
 public:
  explicit Background(const Words& arguments, const std::optional<OnTerminal>& terminal = std::nullopt);
  ~Background();
  Background(const Background&) = delete;
  Background& operator=(const Background&) = delete;
  void signal(int number) const;
  /// On a terminal: what a person types there.
  void type(const std::string& text) const;
  /// Waits for its end.
  [[nodiscard]] Outcome end();
  /// Waits until it has said so on standard output; false when it ended without, or did not within two minutes.
  [[nodiscard]] bool says(const std::string& text);
  /// Waits until this holds for all that was said so far.
  [[nodiscard]] bool says(const std::function<bool(const std::string& so_far)>& enough);
  /// What it has said so far.
  [[nodiscard]] const std::string& said() const noexcept { return outcome_.out; }
  /// Gives its terminal another size.
  void resize(unsigned short columns, unsigned short rows) const;
  [[nodiscard]] pid_t pid() const noexcept { return pid_; }

 private:
  void read_all(int timeout_ms, const std::function<bool()>& enough);
  pid_t pid_ = -1;
  int out_ = -1;
  int err_ = -1;
  Outcome outcome_;
};

/// A folder that goes with its object.
class Folder {
 public:
  Folder();
  ~Folder();
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  [[nodiscard]] std::string file(const std::string& name) const { return path_ + "/" + name; }
  /// Writes a file and gives its name.
  std::string write(const std::string& name, const std::string& text) const;
  /// Copies this file or folder of examples/ under the same name and gives that: what a machine file may name.
  [[nodiscard]] std::string bring(const std::string& example) const;

 private:
  std::string path_;
};

[[nodiscard]] std::string contents(const std::string& path);
[[nodiscard]] bool exists(const std::string& path);
[[nodiscard]] std::string example(const std::string& name);

}  // namespace berth::test
