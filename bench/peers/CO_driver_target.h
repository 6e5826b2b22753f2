/* What CANopenNode wants to know of its target: here two nodes in one process, joined without a bus (canopennode.c). */
#ifndef CO_DRIVER_TARGET_H
#define CO_DRIVER_TARGET_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define CO_CONFIG_SDO_CLI (CO_CONFIG_SDO_CLI_ENABLE | CO_CONFIG_SDO_CLI_SEGMENTED)
#define CO_CONFIG_FIFO CO_CONFIG_FIFO_ENABLE

#define CO_LITTLE_ENDIAN
#define CO_SWAP_16(x) x
#define CO_SWAP_32(x) x
#define CO_SWAP_64(x) x
typedef uint_fast8_t bool_t;
typedef float float32_t;
typedef double float64_t;

typedef struct {
  uint32_t ident;
  uint8_t DLC;
  uint8_t data[8];
} CO_CANrxMsg_t;
#define CO_CANrxMsg_readIdent(msg) ((uint16_t)((CO_CANrxMsg_t*)(msg))->ident)
#define CO_CANrxMsg_readDLC(msg) (((CO_CANrxMsg_t*)(msg))->DLC)
#define CO_CANrxMsg_readData(msg) (((CO_CANrxMsg_t*)(msg))->data)

typedef struct {
  uint16_t ident;
  uint16_t mask;
  void* object;
  void (*CANrx_callback)(void* object, void* message);
} CO_CANrx_t;
typedef struct {
  uint32_t ident;
  uint8_t DLC;
  uint8_t data[8];
  volatile bool_t bufferFull;
  volatile bool_t syncFlag;
} CO_CANtx_t;
typedef struct {
  void* CANptr;
  CO_CANrx_t* rxArray;
  uint16_t rxSize;
  CO_CANtx_t* txArray;
  uint16_t txSize;
  uint16_t CANerrorStatus;
  volatile bool_t CANnormal;
  volatile bool_t useCANrxFilters;
  volatile bool_t bufferInhibitFlag;
  volatile bool_t firstCANtxMessage;
  volatile uint16_t CANtxCount;
  uint32_t errOld;
  bool_t waits; /* a frame that was sent and not delivered yet */
  CO_CANrxMsg_t frame;
} CO_CANmodule_t;
typedef struct {
  void* addr;
  size_t len;
  uint8_t subIndexOD;
  uint8_t attr;
  void* addrNV;
} CO_storage_entry_t;

#define CO_LOCK_CAN_SEND(CAN_MODULE)
#define CO_UNLOCK_CAN_SEND(CAN_MODULE)
#define CO_LOCK_EMCY(CAN_MODULE)
#define CO_UNLOCK_EMCY(CAN_MODULE)
#define CO_LOCK_OD(CAN_MODULE)
#define CO_UNLOCK_OD(CAN_MODULE)
#define CO_MemoryBarrier()
#define CO_FLAG_READ(rxNew) ((rxNew) != NULL)
#define CO_FLAG_SET(rxNew) \
  {                        \
    CO_MemoryBarrier();    \
    rxNew = (void*)1L;     \
  }
#define CO_FLAG_CLEAR(rxNew) \
  {                          \
    CO_MemoryBarrier();      \
    rxNew = NULL;            \
  }

#endif
