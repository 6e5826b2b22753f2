#include "berth/io/plant_port.hpp"

#include <poll.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <deque>

#include "berth/io/plant_socket.hpp"

namespace berth::io {

/// Takes messages from the socket between jobs, and delivers one per job.
class PlantPort::Impl final : private Watcher, private rt::Job {
 public:
  Impl(Loop& loop, int fd, const can::Status& status)
      : executor_(&loop.executor()), socket_(loop, fd, *this), status_(status) {}
  ~Impl() = default;

  can::Queued send(const can::Frame& frame, std::uint32_t tag) noexcept {
    if (!socket_.open() || !status_.up || frame.fd || frame.size > 8) return can::Queued::closed;
    if (status_.bus_off) return can::Queued::bus_off;
    if (status_.listen_only) return can::Queued::listen_only;
    if (given_.size() >= queue_depth) return can::Queued::full;
    Message m{.kind = MessageKind::send};
    m.tag = ++last_;
    m.frame = frame;
    if (!socket_.send(m)) return can::Queued::closed;
    given_.push_back({m.tag, tag});
    return can::Queued::yes;
  }
  // The plant is asked to take the frame back, and does not confirm that it did: the frame counts as gone here.
  void withdraw(std::uint32_t tag) noexcept {
    const auto it = std::ranges::find(given_, tag, &Given::theirs);
    if (tag == 0 || it == given_.end()) return;
    Message m{.kind = MessageKind::withdraw};
    m.tag = it->own;
    given_.erase(it);
    socket_.send(m);
  }
  void listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept {
    listener_ = listener;
    Message m{.kind = MessageKind::listen};
    if (listener != nullptr && accept.size() > most_ranges) {
      m.ranges = {can::all_base, can::all_extended};
    } else if (listener != nullptr) {
      m.ranges.assign(accept.begin(), accept.end());
    }
    socket_.send(m);
  }
  [[nodiscard]] can::Status status() const noexcept {
    can::Status s = status_;
    s.queued = static_cast<std::uint16_t>(given_.size());
    return s;
  }
  bool restart(std::uint32_t bit_rate) noexcept {
    Message m{.kind = MessageKind::restart};
    m.number = bit_rate;
    if (bit_rate == 0 || !socket_.send(m)) return false;
    given_.clear();
    status_.bus_off = false;
    status_.bit_rate = bit_rate;
    return true;
  }

 private:
  struct Given {
    std::uint32_t own;
    std::uint32_t theirs;
  };
  struct Event {
    Message message;
    rt::Time at;
  };

  void ready(std::uint32_t events) noexcept override {
    if ((events & EPOLLOUT) != 0) socket_.flush();
    const rt::Time at = executor_->now();
    for (unsigned i = 0; i < PlantSocket::most_at_once; ++i) {
      auto message = socket_.receive();
      if (!message) break;
      if (events_.size() >= events_kept) {
        socket_.close();
        break;
      }
      events_.push_back({std::move(*message), at});
    }
    if (socket_.closing()) {
      socket_.close();
      Message gone{.kind = MessageKind::changed};
      gone.status.bit_rate = status_.bit_rate;
      events_.push_back({gone, at});
    }
    if (!events_.empty()) executor_->post(*this);
  }

  void run() noexcept override {
    if (events_.empty()) return;
    const Event event = std::move(events_.front());
    events_.pop_front();
    if (!events_.empty()) executor_->post(*this);
    deliver(event.message, executor_->now());
  }

  void deliver(const Message& m, rt::Time at) noexcept {
    switch (m.kind) {
      case MessageKind::received:
        if (listener_ != nullptr) listener_->received(m.frame, at);
        break;
      case MessageKind::sent:
      case MessageKind::not_sent: {
        const auto it = std::ranges::find(given_, m.tag, &Given::own);
        if (it == given_.end()) break;  // withdrawn, but on the wire all the same
        const std::uint32_t tag = it->theirs;
        given_.erase(it);
        if (m.kind == MessageKind::sent && tag != 0 && listener_ != nullptr) listener_->sent(tag, at);
        break;
      }
      case MessageKind::changed:
        status_ = m.status;
        if (!status_.up) given_.clear();
        if (listener_ != nullptr) listener_->changed(status(), at);
        break;
      default: break;  // a server sends nothing else after its welcome
    }
  }

  rt::Executor* executor_;
  PlantSocket socket_;
  can::Status status_;
  can::Listener* listener_ = nullptr;
  std::vector<Given> given_;
  std::deque<Event> events_;
  std::uint32_t last_ = 0;
};

namespace {

std::string reason() { return std::strerror(errno); }

// The status in the welcome, or why there is none.
tl::expected<can::Status, std::string> greet(int fd, std::string_view bus, rt::Duration timeout) {
  Message hello{.kind = MessageKind::hello};
  hello.text = bus;
  const auto packet = encode(hello);
  if (::send(fd, packet.data(), packet.size(), MSG_NOSIGNAL) < 0) return tl::unexpected(reason());
  pollfd wait{fd, POLLIN, 0};
  const auto ms = std::chrono::duration_cast<std::chrono::milliseconds>(timeout).count();
  if (::poll(&wait, 1, static_cast<int>(ms)) <= 0) return tl::unexpected(std::string("the plant does not answer"));
  std::array<std::uint8_t, longest_message> buffer;
  const auto n = ::recv(fd, buffer.data(), buffer.size(), 0);
  const auto answer = n > 0 ? decode({buffer.data(), static_cast<std::size_t>(n)}) : std::nullopt;
  if (answer && answer->kind == MessageKind::welcome) return answer->status;
  if (answer && answer->kind == MessageKind::refused) return tl::unexpected(answer->text);
  return tl::unexpected(std::string("the program that listens there speaks another protocol"));
}

}  // namespace

tl::expected<std::unique_ptr<PlantPort>, std::string> PlantPort::connect(Loop& loop, const std::string& path,
                                                                         std::string_view bus, rt::Duration timeout) {
  sockaddr_un address{};
  if (!address_of(path, address)) return tl::unexpected(path + ": too long for a socket's name");
  const int fd = ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
  if (fd < 0) return tl::unexpected(reason());
  const void* const plain = &address;
  if (::connect(fd, static_cast<const sockaddr*>(plain), sizeof address) != 0) {
    const std::string why =
        path + ": no plant listens there (" + reason() + "); start one: berth plant PLANT --listen " + path;
    ::close(fd);
    return tl::unexpected(why);
  }
  const auto status = greet(fd, bus, timeout);
  if (!status) {
    ::close(fd);
    return tl::unexpected(path + ": " + status.error());
  }
  return std::unique_ptr<PlantPort>(new PlantPort(std::make_unique<Impl>(loop, fd, *status)));
}

PlantPort::PlantPort(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
PlantPort::~PlantPort() = default;
can::Queued PlantPort::send(const can::Frame& frame, std::uint32_t tag) noexcept { return impl_->send(frame, tag); }
void PlantPort::withdraw(std::uint32_t tag) noexcept { impl_->withdraw(tag); }
void PlantPort::listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept {
  impl_->listen(listener, accept);
}
can::Status PlantPort::status() const noexcept { return impl_->status(); }
bool PlantPort::restart(std::uint32_t bit_rate) noexcept { return impl_->restart(bit_rate); }

}  // namespace berth::io
