#include <sys/epoll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "berth/io/plant_port.hpp"
#include "berth/io/plant_socket.hpp"

namespace berth::io {

class PlantServer::Impl final : private Watcher {
 public:
  Impl(Loop& loop, int fd, std::string path, Factory factory)
      : loop_(&loop), fd_(fd), path_(std::move(path)), factory_(std::move(factory)) {
    loop_->watch(fd_, *this, EPOLLIN);
  }
  ~Impl() {
    clients_.clear();
    loop_->forget(fd_);
    ::close(fd_);
    ::unlink(path_.c_str());
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;
  [[nodiscard]] std::size_t clients() const noexcept { return clients_.size(); }

 private:
  /// One client: its socket and its node.
  class Client final : private Watcher, private can::Listener, private rt::Job {
   public:
    Client(Impl& server, int fd) : server_(&server), socket_(*server.loop_, fd, *this) {}
    ~Client() {
      if (port_) port_->listen(nullptr, {});
    }
    [[nodiscard]] bool over() const noexcept { return socket_.closing(); }

   private:
    void ready(std::uint32_t events) noexcept override {
      if ((events & EPOLLOUT) != 0) socket_.flush();
      // So many at a time, that a client which writes without end holds up no other.
      for (unsigned i = 0; i < PlantSocket::most_at_once; ++i) {
        const auto message = socket_.receive();
        if (!message) break;
        if (!act(*message)) socket_.close();
      }
      if (over()) server_->reap();  // destroys this
    }
    // False: it is not to say this, or not now.
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
      if (server_->clients_.size() <= most_clients) port_ = server_->factory_(bus, why);
      if (!port_) {
        Message refused{.kind = MessageKind::refused};
        refused.text = why;
        socket_.send(refused);
        return false;
      }
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
      socket_.send(answer);
    }
    void tell_status(MessageKind kind, const can::Status& status) {
      Message m{.kind = kind};
      m.status = status;
      told_ = status;
      socket_.send(m);
    }
    // Counters move without a word of the port's.
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
      socket_.send(m);
    }
    void sent(std::uint32_t tag, rt::Time) noexcept override {
      Message m{.kind = MessageKind::sent};
      m.tag = tag;
      socket_.send(m);
    }
    void changed(const can::Status& status, rt::Time) noexcept override { tell_status(MessageKind::changed, status); }

    Impl* server_;
    PlantSocket socket_;
    std::unique_ptr<can::Port> port_;
    can::Status told_{};
  };

  void ready(std::uint32_t) noexcept override {
    for (;;) {
      const int fd = ::accept4(fd_, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
      if (fd < 0 && errno == EINTR) continue;
      if (fd < 0) return;
      if (clients_.size() > most_clients) {
        ::close(fd);
        continue;
      }
      clients_.push_back(std::make_unique<Client>(*this, fd));
    }
  }
  void reap() noexcept {
    std::erase_if(clients_, [](const auto& c) { return c->over(); });
  }

  Loop* loop_;
  int fd_;
  std::string path_;
  Factory factory_;
  std::vector<std::unique_ptr<Client>> clients_;
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
