"""As much of Cyclone DDS (libddsc) as a robot needs, by ctypes: writers and readers with the QoS of idl/README.md."""
import ctypes
from ctypes import POINTER, byref, c_bool, c_char_p, c_int32, c_int64, c_size_t, c_uint32, c_uint64, c_void_p

SECOND = 1_000_000_000  # The DDS counts in nanoseconds.
BATCH = 16  # Samples that are taken at once.


class _SampleInfo(ctypes.Structure):  # dds_sample_info_t
    _fields_ = [("states", c_uint32 * 3), ("valid_data", c_bool), ("source_timestamp", c_int64),
                ("handles", c_uint64 * 2), ("counts_and_ranks", c_uint32 * 5)]


class _Matched(ctypes.Structure):  # dds_publication_matched_status_t
    _fields_ = [("total", c_uint32), ("total_change", c_int32), ("current", c_uint32), ("current_change", c_int32),
                ("last_subscription", c_uint64)]


class Dds:
    """A participant of a domain. `library` is what build.sh has made; libddsc is loaded with it."""

    def __init__(self, library, domain):
        self.library = ctypes.CDLL(str(library))
        for name, result, *arguments in (
                ("dds_create_participant", self._checked, c_uint32, c_void_p, c_void_p),
                ("dds_create_topic", self._checked, c_int32, c_void_p, c_char_p, c_void_p, c_void_p),
                ("dds_create_writer", self._checked, c_int32, c_int32, c_void_p, c_void_p),
                ("dds_create_reader", self._checked, c_int32, c_int32, c_void_p, c_void_p),
                ("dds_write", self._checked, c_int32, c_void_p),
                ("dds_take", self._checked, c_int32, POINTER(c_void_p), POINTER(_SampleInfo), c_size_t, c_uint32),
                ("dds_return_loan", self._checked, c_int32, POINTER(c_void_p), c_int32),
                ("dds_get_publication_matched_status", self._checked, c_int32, POINTER(_Matched)),
                ("dds_delete", self._checked, c_int32),
                ("dds_strretcode", c_char_p, c_int32),
                ("dds_create_qos", c_void_p),
                ("dds_delete_qos", None, c_void_p),
                ("dds_qset_reliability", None, c_void_p, c_int32, c_int64),
                ("dds_qset_durability", None, c_void_p, c_int32),
                ("dds_qset_history", None, c_void_p, c_int32, c_int32),
                ("dds_qset_liveliness", None, c_void_p, c_int32, c_int64)):
            function = getattr(self.library, name)
            function.restype, function.argtypes = result, arguments
        self.participant = self.library.dds_create_participant(domain, None, None)

    def _checked(self, code):
        if code < 0:
            raise RuntimeError("DDS: " + self.library.dds_strretcode(code).decode())
        return code

    def _create(self, create, kind, topic, kept, depth, lease_s=0.0):
        lib, qos = self.library, self.library.dds_create_qos()
        lib.dds_qset_reliability(qos, 1, SECOND)  # Reliable; a write waits for at most a second.
        lib.dds_qset_durability(qos, 1 if kept else 0)  # Transient-local: late joiners get the last samples.
        lib.dds_qset_history(qos, 0, depth)  # The last samples of each key.
        if lease_s:
            lib.dds_qset_liveliness(qos, 0, int(lease_s * SECOND))  # Asserted by the library.
        description = c_uint32.in_dll(lib, kind.__name__ + "_desc")  # It begins with the size of the C structure.
        if description.value != ctypes.sizeof(kind):
            raise RuntimeError(f"{kind.__name__} has another size in C than in Python")
        described = lib.dds_create_topic(self.participant, byref(description), topic.encode(), None, None)
        entity = create(self.participant, described, qos, None)
        lib.dds_delete_qos(qos)
        return entity

    def writer(self, kind, topic, kept=False, depth=1, lease_s=0.0):
        return self._create(self.library.dds_create_writer, kind, topic, kept, depth, lease_s)

    def reader(self, kind, topic, kept=False, depth=1):
        return kind, self._create(self.library.dds_create_reader, kind, topic, kept, depth)

    def write(self, writer, message):
        self.library.dds_write(writer, byref(message))

    def matched(self, writer):
        status = _Matched()
        self.library.dds_get_publication_matched_status(writer, byref(status))
        return status.current > 0

    def take(self, reader):
        """Yields what has arrived. A message is valid until the next one is asked for: the DDS owns its memory."""
        kind, entity = reader
        count = BATCH
        while count == BATCH:
            samples, infos = (c_void_p * BATCH)(), (_SampleInfo * BATCH)()
            count = self.library.dds_take(entity, samples, infos, BATCH, BATCH)
            for sample, info in zip(samples[:count], infos):
                if info.valid_data:
                    yield ctypes.cast(sample, POINTER(kind)).contents
            if count > 0:
                self.library.dds_return_loan(entity, samples, count)

    def close(self):
        self.library.dds_delete(self.participant)
