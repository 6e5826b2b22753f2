#include <sys/epoll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "berth/io/acceptor.hpp"
#include "berth/io/plant_port.hpp"
#include "berth/io/plant_socket.hpp"
#include "berth/io/seats.hpp"

namespace berth::io {

class PlantServer::Impl final {
 public:
  Impl(Loop& loop, int fd, std::string path, Factory factory)
      : loop_(&loop),
        path_(std::move(path)),
        factory_(std::move(factory)),
        acceptor_(loop, fd, [this](int client) { take(client); }) {}
  ~Impl() {
    clients_.clear();
    ::unlink(path_.c_str());
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;
  [[nodiscard]] std::size_t clients() const noexcept { return clients_.size(); }

 private:
  /// One client: its socket and its node.
  class Client final : private Watcher, private can::Listener, private rt::Job, private Seat::Sitter {
   public:
    Client(Impl& server, int fd)
        : server_(&server), socket_(*server.loop_, fd, *this), seat_(server.seats_, *this, {}) {}
    ~Client() {
      if (port_) port_->listen(nullptr, {});
    }
    [[nodiscard]] bool over() const noexcept { return socket_.closing(); }
    [[nodiscard]] bool is_node() const noexcept { return port_ != nullptr; }

   private:
    [[nodiscard]] bool owed() const noexcept override { return is_node(); }
    void seat_lost(Seat::End) noexcept override {
      socket_.close();
      server_->loop_->executor().post(server_->reaper_);
    }
    void say(const Message& message) {
      socket_.send(message);
      seat_.output(socket_.taken(), socket_.waiting());
    }
    void ready(std::uint32_t events) noexcept override {
      if ((events & EPOLLOUT) != 0) socket_.flush();
      seat_.output(socket_.taken(), socket_.waiting());
      // At most this many at a time: a client that writes without end must not hold up the others.
      for (unsigned i = 0; i < PlantSocket::most_at_once; ++i) {
        const auto message = socket_.receive();
        if (!message) break;
        if (!act(*message)) socket_.close();
      }
      if (over()) server_->reap();  // destroys this
    }
    // False: the client must not send this, or not now.
    bool act(const Message& m) noexcept {
      if (!port_) return m.kind == MessageKind::hello && enter(m.text);
      switch (m.kind) {
        case MessageKind::send: give(m); return true;
        case MessageKind::withdraw: port_->withdraw(m.tag); return true;
        case MessageKind::listen: port_->listen(this, m.ranges); return true;
        case MessageKind::restart: port_->restart(m.number); return true;
        default: return false;
      }
    }
    bool enter(const std::string& bus) {
      std::string why = "the plant takes no more";
      if (server_->nodes() < most_clients) port_ = server_->factory_(bus, why);
      if (!port_) {
        Message refused{.kind = MessageKind::refused};
        refused.text = why;
        say(refused);
        return false;
      }
      seat_.whole_request();
      port_->listen(this, {});
      tell_status(MessageKind::welcome, port_->status());
      server_->loop_->executor().after(status_period, *this);
      return true;
    }
    void give(const Message& m) noexcept {
      const auto queued = m.tag == 0 ? can::Queued::closed : port_->send(m.frame, m.tag);
      if (queued == can::Queued::yes) return;
      Message answer{.kind = MessageKind::not_sent};
      answer.tag = m.tag;
      answer.reason = queued;
      say(answer);
    }
    void tell_status(MessageKind kind, const can::Status& status) {
      Message m{.kind = kind};
      m.status = status;
      told_ = status;
      say(m);
    }
    // The port does not report changes of its counters.
    void run() noexcept override {
      const auto now = port_->status();
      if (now.errors != told_.errors || now.tec != told_.tec || now.rec != told_.rec)
        tell_status(MessageKind::changed, now);
      server_->loop_->executor().after(status_period, *this);
    }
    void received(const can::Frame& frame, rt::Time) noexcept override {
      const auto now = port_->status();
      if (now.errors != told_.errors) tell_status(MessageKind::changed, now);
      Message m{.kind = MessageKind::received};
      m.frame = frame;
      say(m);
    }
    void sent(std::uint32_t tag, rt::Time) noexcept override {
      Message m{.kind = MessageKind::sent};
      m.tag = tag;
      say(m);
    }
    void changed(const can::Status& status, rt::Time) noexcept override { tell_status(MessageKind::changed, status); }

    Impl* server_;
    PlantSocket socket_;
    Seat seat_;
    std::unique_ptr<can::Port> port_;
    can::Status told_{};
  };
  class Reaper final : public rt::Job {
   public:
    explicit Reaper(Impl& server) : server_(&server) {}
    void run() noexcept override { server_->reap(); }

   private:
    Impl* server_;
  };

  void take(int fd) {
    if (!seats_.make_room({})) return static_cast<void>(::close(fd));
    clients_.push_back(std::make_unique<Client>(*this, fd));
  }
  [[nodiscard]] std::size_t nodes() const noexcept {
    return static_cast<std::size_t>(std::ranges::count_if(clients_, [](const auto& c) { return c->is_node(); }));
  }
  void reap() noexcept {
    std::erase_if(clients_, [](const auto& c) { return c->over(); });
  }

  Loop* loop_;
  std::string path_;
  Factory factory_;
  Reaper reaper_{*this};
  Seats seats_{loop_->executor(), {.most = most_clients + 1}};  // one more, which is told that there is no room
  std::vector<std::unique_ptr<Client>> clients_;
  Acceptor acceptor_;
};

tl::expected<std::unique_ptr<PlantServer>, std::string> PlantServer::listen(Loop& loop, const std::string& path,
                                                                            Factory factory) {
  sockaddr_un address{};
  if (!address_of(path, address)) return tl::unexpected(path + ": too long for a socket's name");
  const void* const plain = &address;
  const auto* const where = static_cast<const sockaddr*>(plain);
  struct stat there {};
  if (::stat(path.c_str(), &there) == 0) {
    if (!S_ISSOCK(there.st_mode)) return tl::unexpected(path + ": a file of this name is there, and no socket");
    const int probe = ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
    const bool answers = probe >= 0 && (::connect(probe, where, sizeof address) == 0 || errno != ECONNREFUSED);
    if (probe >= 0) ::close(probe);
    if (answers) return tl::unexpected(path + ": another process listens there");
    ::unlink(path.c_str());
  }
  const int fd = ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  const mode_t before = ::umask(0177);
  const bool bound = fd >= 0 && ::bind(fd, where, sizeof address) == 0 && ::listen(fd, 16) == 0;
  const std::string why = std::strerror(errno);
  ::umask(before);
  if (!bound) {
    if (fd >= 0) ::close(fd);
    return tl::unexpected(path + ": " + why);
  }
  return std::unique_ptr<PlantServer>(new PlantServer(std::make_unique<Impl>(loop, fd, path, std::move(factory))));
}

PlantServer::PlantServer(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
PlantServer::~PlantServer() = default;
std::size_t PlantServer::clients() const noexcept { return impl_->clients(); }

}  // namespace berth::io
