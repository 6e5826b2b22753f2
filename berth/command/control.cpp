#include "berth/command/control.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <optional>

#include "berth/command/execute.hpp"
#include "berth/command/verbs.hpp"

namespace berth::command {
namespace {

constexpr std::size_t longest_request = 64 * 1024;
constexpr std::size_t longest_answer = std::size_t{16} << 20U;

class Descriptor {
 public:
  explicit Descriptor(int fd) noexcept : fd_(fd) {}
  ~Descriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  [[nodiscard]] int get() const noexcept { return fd_; }
  int release() noexcept { return std::exchange(fd_, -1); }

 private:
  int fd_;
};

std::string reason(int error) { return std::strerror(error); }

bool address_of(const std::string& path, sockaddr_un& address) {
  address = {};
  address.sun_family = AF_UNIX;
  if (path.empty() || path.size() >= sizeof(address.sun_path)) return false;
  std::memcpy(address.sun_path, path.data(), path.size());
  return true;
}

// The type that the socket functions take.
const sockaddr* plain(const sockaddr_un& address) noexcept { return reinterpret_cast<const sockaddr*>(&address); }

std::string too_long(const std::string& path) {
  return fmt::format("{}: no name for a socket: it must have 1 to {} bytes; give another with --control", path,
                     sizeof(sockaddr_un::sun_path) - 1);
}

/// The process at the other end of a connection; empty if the system does not report it.
std::optional<ucred> peer_of(int fd) {
  ucred who{};
  socklen_t size = sizeof who;
  if (::getsockopt(fd, SOL_SOCKET, SO_PEERCRED, &who, &size) != 0) return std::nullopt;
  return who;
}

/// A process of this user, or of root: root can do everything anyway.
bool trusted(const std::optional<ucred>& peer) noexcept { return peer && (peer->uid == ::geteuid() || peer->uid == 0); }

/// Never waits: EAGAIN if the listener's queue is full.
bool connects(int fd, const sockaddr_un& address) noexcept {
  return ::connect(fd, plain(address), sizeof address) == 0;
}

/// The process that listens at a path; 0: none; -1: a process listens, but the system does not report which.
pid_t listener_of(const sockaddr_un& address) {
  const Descriptor fd(::socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  if (fd.get() < 0) return 0;
  if (!connects(fd.get(), address)) return errno == EAGAIN ? -1 : 0;
  const auto who = peer_of(fd.get());
  return who ? who->pid : -1;
}

// A user who can write into the folder could replace our socket by another. A missing folder is no problem: no process
// listens in it.
std::string untrusted_folder(const std::string& path) {
  const auto slash = path.rfind('/');
  const std::string folder = slash == std::string::npos ? std::string() : path.substr(0, slash);
  const bool ours_by_name = folder == fmt::format("/tmp/berth-{}", ::getuid());
  struct stat itself {};
  if (!ours_by_name || ::lstat(folder.c_str(), &itself) != 0) return {};
  const bool safe = S_ISDIR(itself.st_mode) && itself.st_uid == ::getuid() && (itself.st_mode & 0077U) == 0;
  return safe ? std::string()
              : fmt::format("{}: other users have access to this folder; remove it or give --control", folder);
}

std::string make_folder(const std::string& path) {
  const auto slash = path.rfind('/');
  if (slash == std::string::npos || slash == 0) return {};
  const std::string folder = path.substr(0, slash);
  struct stat status {};
  // If the user names a folder, the user must make it.
  const bool ours = folder == fmt::format("/tmp/berth-{}", ::getuid());
  if (!ours && (::stat(folder.c_str(), &status) != 0 || !S_ISDIR(status.st_mode))) {
    return fmt::format("{}: there is no such folder for the control socket", folder);
  }
  if (!ours || ::mkdir(folder.c_str(), 0700) == 0) return {};
  const int error = errno;
  const bool there = error == EEXIST && ::stat(folder.c_str(), &status) == 0 && S_ISDIR(status.st_mode);
  if (!there) return fmt::format("{}: the folder cannot be made: {}", folder, reason(error));
  return untrusted_folder(path);
}

}  // namespace

std::string control_path(const std::string& machine) {
  std::string name = machine;
  for (char& c : name) {
    const auto byte = static_cast<unsigned char>(c);
    if (std::isalnum(byte) == 0 && c != '.' && c != '-' && c != '_') c = '_';
  }
  const char* const runtime = std::getenv("XDG_RUNTIME_DIR");
  struct stat status {};
  const bool usable = runtime != nullptr && *runtime == '/' && ::stat(runtime, &status) == 0 && S_ISDIR(status.st_mode);
  return usable ? fmt::format("{}/berth-{}.sock", runtime, name)
                : fmt::format("/tmp/berth-{}/{}.sock", ::getuid(), name);
}

// ---- the client ----

namespace {

using Deadline = std::chrono::steady_clock::time_point;

bool ready(int fd, short events, Deadline end) {
  for (;;) {
    const auto left =
        std::chrono::duration_cast<std::chrono::milliseconds>(end - std::chrono::steady_clock::now()).count();
    if (left <= 0) return false;
    pollfd wait{fd, events, 0};
    const int found = ::poll(&wait, 1, static_cast<int>(left));
    if (found >= 0) return found > 0;
    if (errno != EINTR) return false;
  }
}

/// Sends the line; empty: all of it was sent.
std::string give(int fd, const std::string& line, Deadline end) {
  for (std::size_t done = 0; done < line.size();) {
    const auto n = ::send(fd, line.data() + done, line.size() - done, MSG_NOSIGNAL);
    if (n > 0) {
      done += static_cast<std::size_t>(n);
    } else if (errno == EAGAIN || errno == EINTR) {
      if (!ready(fd, POLLOUT, end)) return "it is not taken";
    } else {
      return reason(errno);
    }
  }
  return {};
}

}  // namespace

bool control_answers(const std::string& path) {
  sockaddr_un address{};
  return address_of(path, address) && listener_of(address) != 0;
}

namespace {

/// A connection to the process that listens at `path`, if that process is trusted.
tl::expected<int, std::string> connected_to(const std::string& path) {
  sockaddr_un address{};
  if (!address_of(path, address)) return tl::unexpected(too_long(path));
  if (const auto problem = untrusted_folder(path); !problem.empty()) return tl::unexpected(problem);
  Descriptor fd(::socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  if (fd.get() < 0) return tl::unexpected(reason(errno));
  if (!connects(fd.get(), address)) {
    return tl::unexpected(fmt::format("{}: no process listens there ({})", path, reason(errno)));
  }
  if (const auto peer = peer_of(fd.get()); !trusted(peer)) {
    return tl::unexpected(fmt::format("{}: another user ({}) listens there: Berth sent no request; give --control",
                                      path, peer ? std::to_string(peer->uid) : "unknown"));
  }
  return fd.release();
}

}  // namespace

tl::expected<int, std::string> control_follow(const std::string& path) {
  const auto made = connected_to(path);
  if (!made) return tl::unexpected(made.error());
  Descriptor fd(*made);
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(10);
  if (auto problem = give(fd.get(), to_json(Request{"frames", {}}) + "\n", end); !problem.empty())
    return tl::unexpected(fmt::format("{}: the request could not be sent: {}", path, problem));
  return fd.release();
}

namespace {

/// Whether a process is stopped, as by Ctrl-Z. In the file, the state follows the process's name, which may contain any
/// character.
bool is_stopped(pid_t process) {
  std::ifstream file(fmt::format("/proc/{}/stat", process));
  const std::string text((std::istreambuf_iterator<char>(file)), {});
  const auto name_end = text.rfind(')');
  const char state = name_end != std::string::npos && name_end + 2 < text.size() ? text[name_end + 2] : '?';
  return state == 'T' || state == 't';
}

/// Lines of an answer, one after the other.
class Answers {
 public:
  Answers(int fd, const std::string& path, int timeout_ms, const std::function<bool()>& goes_on)
      : fd_(fd),
        path_(path),
        timeout_ms_(timeout_ms),
        end_(Clock::now() + std::chrono::milliseconds(timeout_ms)),
        goes_on_(goes_on) {
    if (const auto peer = peer_of(fd)) process_ = peer->pid;
  }
  [[nodiscard]] Deadline end() const noexcept { return end_; }
  tl::expected<std::string, std::string> next() {
    for (;;) {
      const auto line_end = text_.find('\n');
      if (line_end != std::string::npos) {
        std::string line = text_.substr(0, line_end);
        text_.erase(0, line_end + 1);
        return line;
      }
      if (text_.size() > longest_answer) return problem("the answer has more than {} bytes", longest_answer);
      if (!await()) {
        if (is_stopped(process_)) {
          return problem(
              "process {} runs this machine and is stopped (Ctrl-Z): `kill -CONT {}`, or `fg` in its "
              "terminal, lets it go on",
              process_, process_);
        }
        if (Clock::now() >= end_) return problem("no answer within {} ms; give a longer --timeout", timeout_ms_);
        if (goes_on_ && !goes_on_()) return problem("ended before the answer came");
        continue;
      }
      std::array<char, 65536> buffer;
      const auto n = ::recv(fd_, buffer.data(), buffer.size(), 0);
      if (n < 0 && (errno == EINTR || errno == EAGAIN)) continue;
      if (n <= 0) return problem("the running `berth up` ended before it answered");
      text_.append(buffer.data(), static_cast<std::size_t>(n));
    }
  }

 private:
  using Clock = std::chrono::steady_clock;
  [[nodiscard]] bool await() const {
    constexpr auto to_stopped = std::chrono::milliseconds(500);  // between two looks whether the process is stopped
    constexpr auto to_goes_on = std::chrono::milliseconds(50);
    return ready(fd_, POLLIN, std::min(end_, Clock::now() + (goes_on_ ? to_goes_on : to_stopped)));
  }
  template <class... Values>
  [[nodiscard]] tl::unexpected<std::string> problem(fmt::format_string<Values...> words, Values&&... values) const {
    return tl::unexpected(path_ + ": " + fmt::format(words, std::forward<Values>(values)...));
  }
  int fd_;
  const std::string& path_;
  int timeout_ms_;
  Deadline end_;
  const std::function<bool()>& goes_on_;  // may be empty
  pid_t process_ = 0;
  std::string text_;
};

}  // namespace

tl::expected<Reply, std::string> control_call(const std::string& path, const Request& request, int timeout_ms,
                                              const std::function<void(const std::string& line)>& on_progress,
                                              const std::function<bool()>& goes_on) {
  const auto made = connected_to(path);
  if (!made) return tl::unexpected(made.error());
  const Descriptor fd(*made);
  Answers answers(fd.get(), path, timeout_ms, goes_on);
  const auto problem = give(fd.get(), to_json(request) + "\n", answers.end());
  if (!problem.empty() && problem != reason(EPIPE))  // a server that hung up may have sent the reason
    return tl::unexpected(fmt::format("{}: the request could not be sent: {}", path, problem));
  for (;;) {
    const auto line = answers.next();
    if (!line) return tl::unexpected(line.error());
    const auto progress = parse_progress(*line);
    if (!progress) return parse_reply(*line);
    if (on_progress) on_progress(*progress);
  }
}

// ---- the server ----

/// One connection, with one request at a time: the next begins after the answer has been sent.
struct ControlServer::Client final : private io::Seat::Sitter {
  Client(int descriptor, io::Loop& its_loop, io::Seats& seats, rt::Job& its_end)
      : loop(&its_loop), end(&its_end), fd(descriptor), seat(seats, *this, {}), scope(its_loop.executor()) {}
  ~Client() { loop->forget(fd.get()); }
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;
  [[nodiscard]] bool owed() const noexcept override { return busy; }
  void seat_lost(io::Seat::End) noexcept override {
    lost = true;
    loop->executor().post(*end);
  }
  io::Loop* loop;
  rt::Job* end;
  Descriptor fd;
  io::Seat seat;
  std::uint64_t taken = 0;    // total bytes of `out` that were sent
  bool lost = false;          // the seat was lost
  std::uint32_t watched = 0;  // the events that the loop watches for
  std::string in;
  std::string out;
  Request request;
  Reply reply;
  bool busy = false;
  bool answered = false;
  bool follows = false;       // it gets every frame
  std::uint64_t dropped = 0;  // lines omitted since the last one put into `out`
  rt::Scope scope;            // last member: its task uses the others
};

tl::expected<std::unique_ptr<ControlServer>, std::string> ControlServer::listen(const std::string& path, io::Loop& loop,
                                                                                tree::Session& session) {
  return listen(path, loop,
                [&session](const Request& request, Reply& reply) { return execute(session, request, reply); });
}

tl::expected<std::unique_ptr<ControlServer>, std::string> ControlServer::listen(const std::string& path, io::Loop& loop,
                                                                                Answer answer) {
  sockaddr_un address{};
  if (!address_of(path, address)) return tl::unexpected(too_long(path));
  if (const auto problem = make_folder(path); !problem.empty()) return tl::unexpected(problem);
  if (const pid_t other = listener_of(address); other != 0) {
    return tl::unexpected(
        fmt::format("{}: another `berth up` runs this machine{}; end it first, or give this one another "
                    "--control",
                    path, other > 0 ? fmt::format(", process {}", other) : ""));
  }
  struct stat status {};
  if (::lstat(path.c_str(), &status) == 0) {
    if (!S_ISSOCK(status.st_mode)) return tl::unexpected(path + ": there is a file of this name that is not a socket");
    ::unlink(path.c_str());
  }
  Descriptor fd(::socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  const mode_t before = ::umask(0177);
  const bool bound = fd.get() >= 0 && ::bind(fd.get(), plain(address), sizeof address) == 0;
  const int error = errno;
  ::umask(before);
  if (!bound) return tl::unexpected(fmt::format("{}: {}", path, reason(error)));
  if (::listen(fd.get(), 8) != 0) return tl::unexpected(fmt::format("{}: {}", path, reason(errno)));
  return std::unique_ptr<ControlServer>(new ControlServer(path, fd.release(), loop, std::move(answer)));
}

ControlServer::ControlServer(std::string path, int fd, io::Loop& loop, Answer answer)
    : path_(std::move(path)),
      loop_(&loop),
      answer_(std::move(answer)),
      seats_(loop.executor(), seat_rules),
      acceptor_(loop, fd, [this](int client) { take(client); }) {}

ControlServer::~ControlServer() {
  clients_.clear();
  ::unlink(path_.c_str());
}

void ControlServer::ready(std::uint32_t) noexcept { serve(); }

// Serves all clients, not only the one that is ready: they are few, and none blocks.
void ControlServer::serve() noexcept {
  std::erase_if(clients_, [&](const auto& client) {
    if (client->lost || !read_from(*client) || !write_to(*client)) return true;
    client->seat.output(client->taken, client->out.size());
    client->seat.begun(!client->busy && client->out.empty() && !client->in.empty());
    return false;
  });
  for (const auto& client : clients_) {
    const std::uint32_t events = client->out.empty() ? EPOLLIN : EPOLLIN | EPOLLOUT;
    if (std::exchange(client->watched, events) != events) loop_->watch(client->fd.get(), *this, events);
  }
}

void ControlServer::take(int fd) {
  Descriptor client(fd);
  if (!trusted(peer_of(fd))) return;
  if (seats_.make_room({})) {
    clients_.push_back(std::make_unique<Client>(client.release(), *loop_, seats_, answering_));
    return serve();
  }
  const auto words = fmt::format("{} commands are under way already: try again when one is done", seat_rules.most);
  const std::string line = to_json(refusal(3, words)) + "\n";
  static_cast<void>(::send(fd, line.data(), line.size(), MSG_NOSIGNAL | MSG_DONTWAIT));
}

bool ControlServer::read_from(Client& client) {
  for (;;) {
    char buffer[4096];
    const auto n = ::recv(client.fd.get(), buffer, sizeof buffer, 0);
    if (n == 0) return false;  // the client closed the connection, which also cancels its request
    if (n < 0 && errno == EINTR) continue;
    if (n < 0 && errno != EAGAIN && errno != EWOULDBLOCK) return false;
    if (n < 0) break;
    if (client.in.size() + static_cast<std::size_t>(n) > longest_request) return false;
    client.in.append(buffer, static_cast<std::size_t>(n));
  }
  // A client that does not read its answer gets no further one.
  if (!client.busy && client.out.empty()) begin(client);
  return true;
}

bool ControlServer::followed() const noexcept {
  return std::ranges::any_of(clients_, [](const auto& client) { return client->follows; });
}

void ControlServer::frame(const std::string& line) {
  for (const auto& client : clients_) {
    if (!client->follows) continue;
    if (client->out.size() + line.size() > most_behind) {
      ++client->dropped;
      continue;
    }
    if (client->dropped > 0) client->out += fmt::format("dropped {}\n", std::exchange(client->dropped, 0));
    client->out += line;
  }
  answering_.post();
}

// Takes the next whole line, if there is one.
void ControlServer::begin(Client& client) {
  const auto end = client.in.find('\n');
  if (end == std::string::npos) return;
  const std::string line = client.in.substr(0, end);
  client.in.erase(0, end + 1);
  client.seat.whole_request();
  std::string problem;
  client.request = parse_request(line, problem);
  if (client.request.verb == "frames") {
    client.follows = true;
    return;
  }
  client.busy = true;
  client.reply = {};
  if (client.request.progress) {
    client.reply.progress = [this, &client](const std::string& told) {
      if (client.out.size() < most_behind) client.out += progress_json(told) + "\n";
      answering_.post();
    };
  }
  client.answered = client.request.verb.empty();
  if (client.answered) {
    client.reply = refusal(2, problem);
    answering_.post();
  } else {
    client.scope.spawn(rt::told(answer_(client.request, client.reply), client.answered, loop_->executor(), answering_));
  }
}

bool ControlServer::write_to(Client& client) {
  if (client.busy && client.answered) {
    client.out += to_json(client.reply) + "\n";
    client.reply.progress = {};
    client.busy = client.answered = false;
  }
  while (!client.out.empty()) {
    const auto n = ::send(client.fd.get(), client.out.data(), client.out.size(), MSG_NOSIGNAL);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return errno == EAGAIN || errno == EWOULDBLOCK;
    client.out.erase(0, static_cast<std::size_t>(n));
    client.taken += static_cast<std::uint64_t>(n);
  }
  if (!client.busy) begin(client);  // a request received while the answer was being sent
  return true;
}

}  // namespace berth::command
