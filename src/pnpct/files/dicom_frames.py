"""Enhanced CT images in DICOM: many frames in one file, each with the header of a single image."""

from pydicom import Dataset, FileDataset

FUNCTIONAL_GROUPS = ("SharedFunctionalGroupsSequence", "PerFrameFunctionalGroupsSequence")


def frames_of(header: FileDataset) -> list[Dataset]:
    """Return a header for each frame, in which the elements of its functional groups stand beside the common ones.

    Args:
        header: The header of a file, with its functional groups.

    Returns:
        The headers in the order of the frames; none if the file is no enhanced image.

    References:
        DICOM PS3.3, A.38 (enhanced CT image) and C.7.6.16 (functional groups).
    """
    shared, each = (header.get(name) or [] for name in FUNCTIONAL_GROUPS)
    alike = Dataset()
    for element in header:
        if element.keyword not in (*FUNCTIONAL_GROUPS, "NumberOfFrames"):
            alike.add(element)
    frames = []
    for number, own in enumerate(each, start=1):
        frame = Dataset()
        frame.update(alike)
        frame.InstanceNumber = number
        for group in (*shared, own):
            for element in group:
                if element.VR == "SQ" and element.value:
                    frame.update(element.value[0])
        frame.file_meta = header.file_meta
        frames.append(frame)
    return frames
