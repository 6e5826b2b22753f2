#include "trace_source.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>

#include "berth/base/counted.hpp"
#include "berth/base/read_files.hpp"
#include "berth/can/port_spec.hpp"
#include "berth/command/control.hpp"
#include "berth/io/open_port.hpp"
#include "berth/trace/any_file.hpp"
#include "berth/trace/candump.hpp"
#include "interrupt.hpp"
#include "node_words.hpp"
#include "ports.hpp"
#include "trace_known.hpp"
#include "trace_ring.hpp"

namespace berth::cli {
namespace {

using namespace std::chrono_literals;
using State = TraceSource::State;
using Turned = tl::expected<State, Failure>;
using Opened = tl::expected<std::unique_ptr<TraceSource>, Failure>;

constexpr auto look_again = 50ms;  // interval of looking at a file that may have grown

/// A file, which may still grow, or standard input.
class FileSource final : public TraceSource {
 public:
  FileSource(int fd, std::string name, const TraceOptions& options)
      : fd_(fd), name_(name), follow_(options.follow), file_(std::move(name), options.from.format, options.from.how) {
    if (follow_) interrupt_ = std::make_unique<Interrupt>();
  }
  ~FileSource() override {
    if (fd_ > STDIN_FILENO) ::close(fd_);
  }
  FileSource(const FileSource&) = delete;
  FileSource& operator=(const FileSource&) = delete;

  Turned turn(trace::Sink& sink) override {
    const auto got = ::read(fd_, buffer_.data(), buffer_.size());
    if (got < 0) {
      if (errno == EINTR) return State::more;
      return tl::unexpected(failure(Exit::failed, fmt::format("{}: {}", name_, std::strerror(errno))));
    }
    if (got == 0 && follow_) return wait(sink);
    read_ += got;
    const auto wrong = got == 0 ? file_.end(sink) : file_.feed({buffer_.data(), static_cast<std::size_t>(got)}, sink);
    if (!wrong.empty()) return tl::unexpected(failure(Exit::usage, wrong));
    return got == 0 ? State::over : State::more;
  }

  void finish(trace::Sink& sink) override { file_.finish(sink); }
  const std::vector<std::string>& buses() const noexcept override { return file_.buses(); }
  std::string format() const override {
    const auto format = file_.format();
    return format ? std::string(trace::name(*format)) : "empty";
  }

 private:
  Turned wait(trace::Sink& sink) {
    pollfd stop{interrupt_->descriptor(), POLLIN, 0};
    ::poll(&stop, 1, static_cast<int>(look_again / 1ms));
    if (interrupt_->came()) return State::over;
    struct stat now {};
    if (::fstat(fd_, &now) == 0 && S_ISREG(now.st_mode) && now.st_size < read_) {
      sink.finding(
          {Finding::Severity::warning, name_, 0, 0, {}, "the file became shorter: it is read from its beginning", {}});
      ::lseek(fd_, 0, SEEK_SET);
      read_ = 0;
      file_.begin_anew();
    }
    return State::waiting;
  }

  int fd_;
  std::string name_;
  bool follow_;
  trace::AnyFile file_;
  std::unique_ptr<Interrupt> interrupt_;
  std::int64_t read_ = 0;
  std::vector<char> buffer_ = std::vector<char>(std::size_t{1} << 18U);
};

/// A live bus, only heard.
class PortSource final : public TraceSource, private can::Listener {
 public:
  explicit PortSource(std::string bus, std::string name)
      : loop_(executor_), buses_{std::move(bus)}, name_(std::move(name)) {}
  ~PortSource() override {
    if (port_) port_->listen(nullptr, {});
    port_.reset();
  }
  PortSource(const PortSource&) = delete;
  PortSource& operator=(const PortSource&) = delete;

  std::optional<Failure> open(const can::PortSpec& spec, const io::PortOptions& options) {
    auto port = io::open_port(loop_, spec, options);
    if (!port) return failure(Exit::failed, port.error());
    port_ = std::move(*port);
    // The port's clock starts with the loop; a log counts from 1970.
    since_1970_ = std::chrono::duration_cast<rt::Duration>(std::chrono::system_clock::now().time_since_epoch()) -
                  loop_.clock().time_since_epoch();
    const std::array ranges{can::all_base, can::all_extended};
    port_->listen(this, ranges);
    return std::nullopt;
  }

  Turned turn(trace::Sink& sink) override {
    sink_ = &sink;
    got_ = false;
    loop_.turn(look_again);
    tell_losses();
    sink_ = nullptr;
    if (interrupt_.came()) return State::over;
    return got_ ? State::more : State::waiting;
  }
  void finish(trace::Sink&) override {}
  const std::vector<std::string>& buses() const noexcept override { return buses_; }
  std::string format() const override { return "live"; }

 private:
  void received(const can::Frame& frame, rt::Time at) noexcept override {
    got_ = true;
    entry_.at = at.time_since_epoch() + since_1970_;
    entry_.frame = frame;
    if (sink_ != nullptr) sink_->entry(entry_);
  }
  void sent(std::uint32_t, rt::Time) noexcept override {}
  void changed(const can::Status& status, rt::Time) noexcept override {
    if (sink_ == nullptr || status.up == up_) return;
    up_ = status.up;
    sink_->finding({Finding::Severity::warning, name_, 0, 0, {}, up_ ? "the bus is back" : "the bus is gone", {}});
  }
  void tell_losses() {
    const auto lost = port_->status().lost;
    if (lost == lost_) return;
    sink_->finding({Finding::Severity::warning,
                    name_,
                    0,
                    0,
                    {},
                    fmt::format("{} received and lost on the way", counted(lost - lost_, "frame")),
                    {}});
    lost_ = lost;
  }

  rt::Executor executor_;
  io::Loop loop_;
  Interrupt interrupt_{&loop_};
  std::unique_ptr<can::Port> port_;
  std::vector<std::string> buses_;
  std::string name_;
  rt::Duration since_1970_{};
  trace::Entry entry_;
  trace::Sink* sink_ = nullptr;
  bool got_ = false;
  bool up_ = true;
  std::uint32_t lost_ = 0;
};

/// The frames of a machine that `berth up` runs, through its control socket.
class ControlSource final : public TraceSource {
 public:
  ControlSource(int fd, std::string path) : fd_(fd), path_(std::move(path)), reader_(path_) {}
  ~ControlSource() override { ::close(fd_); }
  ControlSource(const ControlSource&) = delete;
  ControlSource& operator=(const ControlSource&) = delete;

  Turned turn(trace::Sink& sink) override {
    std::array<pollfd, 2> ends{pollfd{fd_, POLLIN, 0}, pollfd{interrupt_.descriptor(), POLLIN, 0}};
    ::poll(ends.data(), ends.size(), static_cast<int>(look_again / 1ms));
    if (interrupt_.came()) return State::over;
    if (ends[0].revents == 0) return State::waiting;
    const auto got = ::read(fd_, buffer_.data(), buffer_.size());
    if (got < 0 && (errno == EINTR || errno == EAGAIN)) return State::waiting;
    if (got <= 0) return State::over;
    feed({buffer_.data(), static_cast<std::size_t>(got)}, sink);
    return State::more;
  }
  void finish(trace::Sink& sink) override { reader_.finish(sink); }
  const std::vector<std::string>& buses() const noexcept override { return reader_.buses(); }
  std::string format() const override { return "live"; }

 private:
  void feed(std::string_view bytes, trace::Sink& sink) {
    rest_ += bytes;
    std::size_t from = 0;
    for (auto end = rest_.find('\n'); end != std::string::npos; end = rest_.find('\n', from)) {
      const std::string_view line = std::string_view(rest_).substr(from, end + 1 - from);
      if (line.starts_with("dropped ")) {
        tell_dropped(line.substr(0, line.size() - 1), sink);
      } else {
        reader_.feed(line, sink);
      }
      from = end + 1;
    }
    rest_.erase(0, from);
  }
  void tell_dropped(std::string_view line, trace::Sink& sink) const {
    sink.finding(
        {Finding::Severity::warning, path_, 0, 0, {}, fmt::format("{} frames: this reader was too slow", line), {}});
  }

  int fd_;
  std::string path_;
  trace::CandumpReader reader_;
  Interrupt interrupt_;
  std::string rest_;  // the beginning of an incomplete line
  std::vector<char> buffer_ = std::vector<char>(std::size_t{1} << 16U);
};

Opened open_live(const TraceOptions& trace, const KnownNodes& known) {
  const design::Bus* machine_bus = nullptr;
  if (known.machine()) {
    const auto& buses = known.machine()->buses;
    machine_bus = !trace.buses.empty() ? known.machine()->bus(trace.buses.front())
                  : buses.size() == 1  ? &buses.front()
                                       : nullptr;
  }
  std::optional<can::PortSpec> spec;
  if (!trace.port.empty()) {
    const auto named = port_of_word(trace.port);
    if (!named) return tl::unexpected(failure(Exit::usage, named.error()));
    spec = *named;
  } else if (machine_bus != nullptr) {
    spec = machine_bus->port;
  }
  if (!spec)
    return tl::unexpected(failure(Exit::usage, "nothing to read: write a file, - or --port; see berth trace --help"));
  std::string bus = !trace.buses.empty() ? trace.buses.front() : machine_bus != nullptr ? machine_bus->name : "";
  io::PortOptions how{.bit_rate = trace.bit_rate.value_or(0), .listen_only = true, .bus = bus};
  if (bus.empty()) bus = spec->address;
  auto source = std::make_unique<PortSource>(bus, can::to_string(*spec));
  if (auto bad = source->open(*spec, how)) return tl::unexpected(std::move(*bad));
  return source;
}

}  // namespace

// Live frames of a machine come only from its buses with a port.
std::optional<Failure> heard_nowhere(const TraceOptions& trace, const KnownNodes& known) {
  if (!known.machine() || !trace.file.empty() || !trace.port.empty()) return std::nullopt;
  for (const auto& name : trace.buses) {
    const auto* const bus = known.machine()->bus(name);
    if (bus == nullptr) return no_such_bus(*known.machine(), name);
    if (bus->own_port) continue;
    return no_port(*bus, "a trace shows what a port hears",
                   fmt::format("without --bus, --node {} shows what the gateways carry for a node there; with a port "
                               "plugged in there: berth trace --port can1",
                               nodes_of(*known.machine(), *bus)));
  }
  return std::nullopt;
}

Opened open_source(const Options& options, const TraceOptions& trace, const KnownNodes& known) {
  if (!trace.file.empty() && !trace.port.empty())
    return tl::unexpected(failure(Exit::usage, "a file or --port, not both"));
  if (trace.from.ring) return open_ring(options, trace, known);
  if (!trace.from.filter.empty())
    return tl::unexpected(failure(Exit::usage, "--filter is for --ring; --text finds words in the rows of a file"));
  if (auto bad = heard_nowhere(trace, known)) return tl::unexpected(std::move(*bad));
  if (trace.file.empty() && trace.port.empty()) {
    const auto path = known.machine() ? running_control(options, *known.machine()) : std::string();
    if (!path.empty()) {
      if (auto other = runs_another(options, path)) return tl::unexpected(std::move(*other));
      const auto fd = command::control_follow(path);
      if (!fd) return tl::unexpected(failure(Exit::failed, fd.error()));
      return std::make_unique<ControlSource>(*fd, path);
    }
  }
  if (trace.file.empty()) return open_live(trace, known);
  if (trace.file == "-") return std::make_unique<FileSource>(STDIN_FILENO, "standard input", trace);
  note_read(trace.file);
  const int fd = ::open(trace.file.c_str(), O_RDONLY | O_CLOEXEC);
  struct stat what {};
  if (fd >= 0 && ::fstat(fd, &what) == 0 && S_ISDIR(what.st_mode)) {
    ::close(fd);
    return tl::unexpected(failure(Exit::usage, trace.file + ": this is a folder"));
  }
  if (fd < 0) return tl::unexpected(failure(Exit::usage, fmt::format("{}: {}", trace.file, std::strerror(errno))));
  return std::make_unique<FileSource>(fd, trace.file, trace);
}

}  // namespace berth::cli
